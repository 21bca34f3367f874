"""Four published tyres (.tir of a military truck tyre) are recovered from rig runs generated with them."""

import numpy as np
import pytest

from identify.make.rig import Plan, make_rig
from identify.rig.chain import fitted, prepare
from plant.sheets.machine import MACHINES, load_machine
from plant.sheets.tyre_file import lacking, read_tir

pytestmark = pytest.mark.data
PSI = (40, 60, 70, 95)


def machine_on(path, folder):
    """The l60 on the tyre of a file, with the groups left out that the plant's tyre has not."""
    file = read_tir(path)
    text = (MACHINES / "l60.toml").read_text(encoding="utf-8")
    names = ", ".join(f'"{group}"' for group in lacking(file))
    out = folder / "machine.toml"
    out.write_text(
        text.replace("[tyre] ", f'[tyre]\ntir = "{path}"\nleave_out = [{names}]\n# ', 1), encoding="utf-8"
    )
    return load_machine(out), file


@pytest.mark.parametrize("psi", PSI)
def test_tyre_of_a_file_is_recovered(recordings, tmp_path, psi):
    machine, file = machine_on(
        recordings / "chrono_feda_tyre" / f"335_65R22_5_G275MSA_{psi}psi.tir", tmp_path
    )
    log, _ = make_rig(machine, 100 + psi, None, Plan(inflation_bar=(), repeats=1, validation=False))
    found = fitted(prepare(log))
    away = []
    for name in ("PCX1", "PDX1", "PDX2", "PEX1", "PEX2", "PKX1"):
        i = found.interval(name)
        away.append((i.value - file.number(name)) / i.sd)
    assert np.max(np.abs(away)) < 4.0
    assert np.sqrt(np.mean(np.square(away))) < 2.0
    assert found.values["PCX1"] == pytest.approx(file.number("PCX1"), rel=0.01)
    assert found.values["PDX1"] == pytest.approx(file.number("PDX1"), rel=0.08)
    assert found.values["PKX1"] == pytest.approx(file.number("PKX1"), rel=0.08)
