"""From a run with hidden effects to the machine that has them, on the command line: found, applied, no longer missing, and felt by plant and ECU.

The library is cut to what could be mistaken for what is hidden, and nothing open-ended is looked for, so that a diagnosis takes seconds.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from discrepancy.examine import investigate
from discrepancy.model.description import Model
from discrepancy.models.loader import model as loader
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Recording
from hil.rundir import RunDirectory
from plant.sheets.machine import load_machine
from tests.diagnosis.cases import Call, loaderhil

__all__ = ["loaderhil"]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
]

SEARCHED = (
    "payload_mass",
    "rolling_resistance",
    "brake_drag",
    "wheel_spin_inertia",
    "lift_pressure scale",
    "yaw_rate scale",
    "yaw_rate delay",
    "yaw_rate lag",
)
DRIVE = """
name = "NAME"
sentence = "Speeds up and slows down in a zigzag, then lifts a little."
duration_s = 11.0
machine = "l60"
payload_kg = 1500
[start]
speed_kmh = 8.0
[driver.speed_kmh]
points = [[0.0, 8.0], [3.0, 12.0], [8.0, 6.0], [11.0, 13.0]]
[driver.articulation_deg]
points = [[0.3, 0.0], [1.5, 15.0], [3.5, -12.0], [6.0, 10.0], [6.8, 10.0], [8.5, -5.0], [11.0, 14.0]]
[driver.lift_percent]
points = [[8.0, 0.0], [8.4, 60.0], [10.0, 60.0], [10.4, 0.0]]
"""
OTHER = DRIVE.replace("[11.0, 13.0]", "[10.0, 9.0]").replace("[3.5, -12.0]", "[4.5, 8.0]")


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = loader.model

    def short(recordings: Sequence[Recording] = (), **chosen: object) -> Model:
        model = whole(recordings, **chosen)  # type: ignore[arg-type]
        return replace(model, effects=tuple(e for e in model.effects if e.name in SEARCHED))

    def without_equations(model, recordings, settings, *rest):  # type: ignore[no-untyped-def]
        return investigate(model, recordings, replace(settings, open_ended=False), *rest)

    monkeypatch.setattr(loader, "model", short)
    monkeypatch.setattr("diagnosis.question.investigate", without_equations)


@pytest.fixture
def hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """A run of the bench with these effects, of which its record says nothing."""
    from loaderhil import cli

    def conceal(name: str, drive: str, seed: int, *effects: str) -> Path:
        scenario = tmp_path / f"{name}.toml"
        scenario.write_text(drive.replace("NAME", name))
        words = [word for effect in effects for word in ("--effect", effect)]
        arguments = [
            "conceal",
            tmp_path / name,
            "--model",
            "loader",
            "--manoeuvre",
            scenario,
            "--seed",
            seed,
            *words,
        ]
        monkeypatch.setattr("sys.argv", ["loaderhil", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert not ended.value.code
        (
            tmp_path / name / "run" / "reference.log"
        ).unlink()  # the machine's own sensors are enough, and half the work
        return tmp_path / name / "run"

    return conceal


def sizes(found: Findings | None) -> dict[str, float]:
    """Every parameter of what was named that says how much."""
    assert found is not None
    return {
        e.name: e.value for f in found.findings if f.named for e in f.parameters if e.baseline is not None
    }


def test_what_was_hidden_is_applied_and_grows(
    loaderhil: Call, hidden: Callable[..., Path], tmp_path: Path
) -> None:
    """Rolling resistance and a late gyro: found and applied; on a new run nothing is missing. Then both grow, and are found and applied with their whole size."""
    machine = tmp_path / "mine.toml"
    diagnose, using = ("diagnose",), ("--model", "loader", "--with", machine)
    first = hidden("first", DRIVE, 5, "rolling_resistance=0.03,0.01", "yaw_rate delay=0.06")
    fresh = hidden("fresh", OTHER, 8, "rolling_resistance=0.03,0.01", "yaw_rate delay=0.06")
    grown = hidden("grown", DRIVE, 12, "rolling_resistance=0.05,0.01", "yaw_rate delay=0.1")

    found = loaderhil(*diagnose, first, "--model", "loader", "--apply", machine).result
    assert sizes(found) == pytest.approx(
        {"rolling_resistance.coefficient": 0.03, "yaw_rate.delay": 0.06}, rel=0.1
    )
    again = loaderhil(*diagnose, fresh, *using).result
    assert again is not None
    assert again.status == "nothing missing", again.named

    more = loaderhil(*diagnose, grown, *using, "--apply", machine).result
    assert sizes(more) == pytest.approx(
        {"rolling_resistance.coefficient": 0.05, "yaw_rate.delay": 0.1}, rel=0.1
    )
    own = load_machine(machine).effects[0]
    assert own.effect.name == "rolling_resistance"
    assert dict(own.named)["coefficient"] == pytest.approx(0.05, rel=0.1)


def test_plant_and_ecu_run_with_what_was_applied(
    loaderhil: Call, hidden: Callable[..., Path], tmp_path: Path
) -> None:
    """More in the bucket, and motors heavier to turn: the machine run with its files is the one that was hidden, and the ECU weighs it."""
    machine, out = tmp_path / "mine.toml", tmp_path / "again"
    first = hidden("first", DRIVE, 3, "payload_mass=900", "wheel_spin_inertia=60")
    found = loaderhil("diagnose", first, "--model", "loader", "--apply", machine)
    assert sizes(found.result) == pytest.approx(
        {"payload_mass.extra_kg": 900.0, "wheel_spin_inertia.extra_kg_m2": 60.0}, rel=0.1
    )
    assert loaderhil("run", tmp_path / "first.toml", "--machine", machine, folder=out).code == 0
    record = json.loads((out / "run.json").read_text())
    assert record["calibration"] == str(tmp_path / "mine.calibration.toml")
    rest = loaderhil("diagnose", out, "--model", "loader", "--with", machine).result
    assert rest is not None
    assert rest.status == "nothing missing", rest.named
    run = RunDirectory.read(out)
    weighed = next(c for c in run.messages.values() if "PayloadMass" in c.signals)
    calm = (weighed.time_s > 4.0) & (weighed.time_s < 8.0)
    assert np.median(weighed.signals["PayloadMass"][calm]) == pytest.approx(1500.0 + 900.0, rel=0.05)
