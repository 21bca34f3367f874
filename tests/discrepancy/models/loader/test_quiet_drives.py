"""Drives with hardly any torque: what the inputs' noise, a nuisance or one speed leaves open gets no wrong name."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from diagnosis.apply.machine_files import baseline
from diagnosis.blind.hidden import Truth
from diagnosis.blind.hidden_run import concealed_run
from discrepancy.examine import examine
from discrepancy.models.loader import model as loader
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings
from hil.compose import Choice

CRUISE = """
name = "scenario"
sentence = "Straight at 12 km/h."
duration_s = 16.0
machine = "l60"
seed = 1
[start]
speed_kmh = 12.0
[driver.speed_kmh]
points = [[0.0, 12.0]]
"""
TURN = """
name = "scenario"
sentence = "A turn of 20 degrees at 8 km/h."
duration_s = 16.0
machine = "l60"
seed = 1
[start]
speed_kmh = 8.0
[driver.speed_kmh]
points = [[0.0, 8.0]]
[driver.articulation_deg]
points = [[1.0, 0.0], [3.0, 20.0]]
"""


def verdict(folder: Path, scenario: str, library: Sequence[str], **hidden: float) -> Findings:
    """The diagnosis of a drive of the lockstep bench; hidden: parameters of one effect by name, a dot as __.

    library: few effects, for the time.
    """
    file = folder / "scenario.toml"
    file.write_text(scenario, encoding="utf-8")
    values = {name.replace("__", "."): value for name, value in hidden.items()}
    effects = {next(iter(values)).split(".")[0]: values} if values else {}
    concealed_run(Choice(scenario=str(file)), Truth(model="loader", seed=1, effects=effects), folder / "run")
    recording = loader.load_run(folder / "run")
    model = baseline(Path("l60"), [recording])
    return examine(
        replace(model, effects=tuple(e for e in model.effects if e.name in library)), [recording], Settings()
    )


@pytest.mark.slow
def test_noise_of_the_torque_sensors_is_no_effect(tmp_path: Path) -> None:
    library = ["brake_drag", "rolling_resistance", "torque_error", "turn_slip"]
    assert verdict(tmp_path, CRUISE, library).status == "nothing missing"


@pytest.mark.slow
def test_turn_slip_is_not_blamed_on_the_motors(tmp_path: Path) -> None:
    result = verdict(tmp_path, TURN, ["torque_error", "turn_slip"], turn_slip__friction=0.9)
    assert result.named == ["turn_slip"]
    [finding] = result.findings
    [size] = [p for p in finding.parameters if p.name == "turn_slip.friction"]
    assert size.low is not None
    assert size.high is not None
    assert size.low < 0.9 < size.high


@pytest.mark.slow
def test_a_resistance_is_not_lost_to_a_twin_at_one_speed(tmp_path: Path) -> None:
    """A constant torque of every wheel is nearly the same there; and the size that the score expects is ten times too large."""
    [finding] = verdict(
        tmp_path, CRUISE, ["brake_drag", "rolling_resistance"], rolling_resistance__coefficient=0.02
    ).findings
    assert finding.effect == "rolling_resistance"
    coefficient = finding.parameters[0]
    assert coefficient.low is not None
    assert coefficient.high is not None
    assert coefficient.low < 0.02 < coefficient.high


@pytest.mark.slow
def test_brakes_that_drag_in_front_alone_are_named(tmp_path: Path) -> None:
    result = verdict(tmp_path, CRUISE, ["brake_drag"], brake_drag__front_N_m=800.0, brake_drag__rear_N_m=0.0)
    [finding] = result.findings
    assert finding.effect == "brake_drag"
    assert finding.named
    front, rear = finding.parameters
    assert front.value == pytest.approx(800.0, rel=0.05)
    assert rear.value < 40.0
