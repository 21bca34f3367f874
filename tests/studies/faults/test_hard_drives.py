"""Hard drives without a fault: a sound sensor is not taken for faulty, in the loop nor with a wrong calibration."""

import random

import pytest

from ecu.calibration import load_calibration
from studies.campaigns.manoeuvres import drawn, scenario_of
from studies.campaigns.wrong_calibration import wrong_parameters
from studies.faults.drives import Detector, driven

CALIBRATION = load_calibration()


# the ones of this seed in which most signals jump, and in which the tyres come closest to their limit
@pytest.mark.parametrize("number", [1, 3], ids=["counter-steer", "kerb"])
def test_a_hard_drive_is_no_fault(number):
    watched = driven(scenario_of(drawn(8, 777)[number]))
    assert watched.reported == ()
    for seed in (None, 1, 2):
        right = CALIBRATION.parameters
        p = right if seed is None else wrong_parameters(right, random.Random(seed))
        judged = Detector(CALIBRATION, p).run(watched.samples, watched.heard, watched.usable)
        assert judged.begins() == []
