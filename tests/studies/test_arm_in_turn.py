"""Loads while a raised, loaded arm is lowered or raised in a turn: the whole chain from the plant to the frame."""

import math

import numpy as np
import pytest

from hil.compose import Choice, lockstep
from studies.campaigns.normal_force import estimates_of

SCENARIO = """
name = "{name}"
sentence = "3204 kg, a turn, and the lift lever moved at speed."
duration_s = 6.5
machine = "l60"
seed = 7
payload_kg = 3204

[start]
speed_kmh = {speed}
lift_arm_deg = {arm}

[driver.speed_kmh]
points = [[0.0, {speed}]]

[driver.articulation_deg]
points = [[1.0, 0.0], [2.5, {angle}], [6.5, {angle}]]

[driver.lift_percent]
points = {lever}
"""
CASES = {
    "lowering": {"speed": 15, "arm": 40, "angle": 22, "lever": "[[4.0, 0.0], [4.5, -100.0], [5.5, -100.0], [6.0, 0.0]]"},
    "raising": {"speed": 12, "arm": -20, "angle": 20, "lever": "[[3.5, 0.0], [3.6, 100.0], [6.0, 100.0], [6.1, 0.0]]"},
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_loads_follow_an_arm_that_moves_in_a_turn(name, tmp_path):
    """With a rigid front unit the front left wheel's RMS error was 3.7 kN lowering and 2.4 kN raising, of 27 kN standing."""
    path = tmp_path / f"{name}.toml"
    path.write_text(SCENARIO.format(name=name, **CASES[name]), encoding="utf-8")
    recording = lockstep(Choice(scenario=str(path)).load(), limits=False, reference=False).run()
    time = np.array([truth.time_s for truth in recording.truth])
    force = np.array([truth.normal_force for truth in recording.truth])
    series = estimates_of(recording)
    moves = series.time_s > 3.4
    assert series.valid[moves].all()
    true = np.array([np.interp(series.time_s[moves], time, force[:, wheel]) for wheel in range(4)]).T
    rms = np.sqrt(np.mean((series.force[moves] - true) ** 2, axis=0))
    assert np.all(rms < 1.7e3)


FULL_LEVER = {"speed": 17, "arm": 46, "angle": 24, "lever": "[[4.0, 0.0], [4.01, -100.0]]"}


def test_a_full_lever_at_speed_lifts_no_wheel_while_the_limits_act(tmp_path):
    """Without limits the front left wheel is in the air after 0.1 s. Every wheel keeps a fifth of its load, and the loads are known."""
    path = tmp_path / "full_lever.toml"
    path.write_text(SCENARIO.format(name="full_lever", **FULL_LEVER), encoding="utf-8")
    recording = lockstep(Choice(scenario=str(path)).load(), reference=False).run()
    time = np.array([truth.time_s for truth in recording.truth])
    force = np.array([truth.normal_force for truth in recording.truth])
    assert (force / force[0]).min() > 0.2
    travel = math.radians(92.0)
    lowered = recording.truth[0].lift_arm_angle - recording.truth[-1].lift_arm_angle
    assert lowered > travel / 10.0, "it comes down: a tenth of its way in 2.5 s"
    series = estimates_of(recording)
    moves = series.time_s > 3.9
    assert series.valid[moves].all()
    true = np.array([np.interp(series.time_s[moves], time, force[:, wheel]) for wheel in range(4)]).T
    assert np.abs(series.force[moves] - true).max() < 3e3
