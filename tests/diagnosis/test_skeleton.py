"""`loaderhil model new`: the skeleton of a model runs at once."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis.models import find_model
from diagnosis.reading.tables import Unreadable
from diagnosis.skeleton import skeleton
from discrepancy.signals.units import parse_unit
from tests.diagnosis.cases import Call, loaderhil

__all__ = ["loaderhil"]


def table(folder: Path) -> Path:
    time_s = 0.1 * np.arange(300)
    pump = 2.0 + np.sin(time_s / 1.7)
    level = 300.0 * pump + np.random.default_rng(1).normal(0.0, 3.0, 300)
    rows = "".join(
        f"{t:.1f},{u:.3f},{x:.1f},{20.0 + 0.01 * x:.2f}\n"
        for t, u, x in zip(time_s, pump, level, strict=True)
    )
    file = folder / "rig.csv"
    file.write_text(f"time [s],Pump Voltage [V],level [mm],2nd temp. [°C]\n{rows}")
    return file


def test_headings_become_channels_with_si_units(tmp_path: Path) -> None:
    file = tmp_path / "rig.py"
    file.write_text(skeleton(table(tmp_path)))
    model = find_model(str(file)).channels
    assert dict(model.inputs) == {"pump_voltage": "V"}
    assert dict(model.outputs) == {"level": "m", "c_2nd_temp": "K"}
    assert model.columns == {"pump_voltage": "Pump Voltage", "c_2nd_temp": "2nd temp."}
    assert parse_unit(model.parameter("level_per_pump_voltage").unit) == parse_unit("m/V")


def test_the_skeleton_runs_at_once(tmp_path: Path, loaderhil: Call) -> None:
    recording, file = table(tmp_path), tmp_path / "rig.py"
    loaderhil("model", "new", recording, folder=file)
    found = loaderhil("diagnose", recording, "--model", file)
    assert found.result is not None
    assert found.result.status != "inconclusive"
    assert not [c for c in found.result.complaints if c.fatal]


@pytest.mark.parametrize("text", ["time [s]\n1\n", "time [s],name\n1,a\n2,b\n"])
def test_a_table_without_numbers_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "a.csv"
    file.write_text(text)
    with pytest.raises(Unreadable):
        skeleton(file)
