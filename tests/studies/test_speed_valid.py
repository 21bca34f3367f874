"""The ECU's speed while wheels slide: what the frame calls valid is right, and a long slide is not called valid."""

import numpy as np
import pytest

from ecu.consistency import DOUBTFUL
from hil.compose import Choice, lockstep
from plant.truth import columns_of as truth_of
from studies.campaigns.memory import columns_of

LATE = 0.1
"""What the error may exceed the doubt by [m/s]: the scatter of rolling wheels, and a frame that is 20 ms old at 3 m/s²."""
SLIDE = """
name = "slide"
sentence = "From 25 km/h on ice the full brake: every wheel slides for seconds."
duration_s = {duration}
machine = "l60"
seed = 3

[surface]
friction = {friction}
grade_percent = {grade}

[start]
speed_kmh = 25.0

[driver.speed_kmh]
points = [[0.0, 25.0]]

[driver.brake_percent]
points = [[1.0, 0.0], [1.15, 100.0]]
"""


def drive(scenario):
    """Time [s], speed in the frame [m/s] and its flag, true speed, and the largest wheel speed [rad/s]."""
    recording = lockstep(Choice(scenario=scenario).load(), limits=False, reference=False).run()
    true = truth_of(np.array([row.row for row in recording.truth]))
    frames = columns_of(recording.bus)["BodyMotion"]
    found = (
        np.interp(frames.time_s, true["time_s"], column)
        for column in (true["speed"], np.abs(true["wheel_speed"]).max(axis=1))
    )
    return frames.time_s, frames.signals["Speed"], frames.signals["SpeedValid"] > 0, *found


@pytest.mark.parametrize(("friction", "grade"), [(0.15, 0.0), (0.2, -8.0), (0.15, 5.0)])
def test_a_long_slide_is_not_valid_and_what_is_valid_is_right(friction, grade, tmp_path):
    file = tmp_path / "slide.toml"
    file.write_text(SLIDE.format(friction=friction, grade=grade, duration=10.0), encoding="utf-8")
    time, speed, valid, true, wheels = drive(str(file))
    sliding = (wheels < 0.05) & (true > 0.5)
    assert sliding.sum() > 75, "it slides for longer than the flag may take"
    assert not valid[sliding][-1]
    assert np.abs(speed - true)[valid].max() < DOUBTFUL + LATE
    assert valid[(time > 0.2) & (time < 1.0)].all()


@pytest.mark.parametrize("scenario", ["unloaded", "transient_articulation", "pile_entry"])
def test_while_wheels_roll_the_speed_is_valid(scenario):
    time, speed, valid, true, _ = drive(scenario)
    assert valid[time > 0.2].mean() > 0.98
    assert np.abs(speed - true)[valid].max() < DOUBTFUL + LATE


@pytest.mark.parametrize("scenario", ["wheel_lock", "hard_braking"])
def test_a_valid_speed_is_right_while_the_brake_grips_or_locks(scenario):
    """It was 0.7 m/s off before wheels that slide took the flag away."""
    time, speed, valid, true, _ = drive(scenario)
    assert valid[(time > 0.2) & (time < 2.0)].all()
    assert np.abs(speed - true)[valid].max() < DOUBTFUL + LATE
