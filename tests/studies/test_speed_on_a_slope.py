"""The ECU's speed where the inclination sensor starts wrong: a machine that rolls freely downhill reads no slope (ADR 86)."""

import numpy as np
import pytest

from ecu.consistency import DOUBTFUL
from studies.campaigns.manoeuvres import Manoeuvre
from studies.campaigns.memory import columns_of
from studies.campaigns.prevention import driven

STRAIGHT_DOWN = Manoeuvre(
    kind="slope",
    speed_kmh=17.3,
    payload_kg=3204,
    arm_deg=29.2,
    angle_deg=0.1,
    rate_deg_s=26.0,
    seed=900405792,
    grade_percent=-18.0,
    bank_deg=3.4,
)
TURNING = Manoeuvre(
    kind="slope",
    speed_kmh=17.3,
    payload_kg=3204,
    arm_deg=29.2,
    angle_deg=-34.3,
    rate_deg_s=26.0,
    seed=900405792,
    grade_percent=-18.0,
    bank_deg=3.4,
)


def error_of(recording):
    """Estimated less true speed of the rear axle [m/s]; the first frame is of the ECU's start."""
    motion = columns_of(recording.bus)["BodyMotion"]
    assert motion.signals["SpeedValid"][1:].all()
    time = motion.time_s[1:]
    true = np.interp(time, [r.time_s for r in recording.truth], [r.velocity[0] for r in recording.truth])
    return motion.signals["Speed"][1:] - true


@pytest.mark.parametrize("drive", [STRAIGHT_DOWN, TURNING])
def test_an_inclination_that_starts_wrong_does_not_take_the_speed_with_it(drive):
    """In the turn the error was 1.9 m/s. A valid speed is right to what its validity allows."""
    _, recording = driven(drive, limits=True)
    assert np.abs(error_of(recording)).max() < DOUBTFUL


def test_a_machine_that_is_not_held_too_slow_keeps_its_wheels_down():
    judged, _ = driven(TURNING, limits=True)
    assert not judged.lifted
