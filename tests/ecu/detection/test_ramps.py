"""A moment that sets in at once: the cylinder's pressure jumps, the frame's pitch rate starts to grow. Newton's law, and no fault."""

import math

import numpy as np
import pytest

from ecu.calibration import load_calibration
from ecu.codes import Mode
from ecu.detection.detector import initial
from ecu.detection.jumps import EXPLAINED, FOLLOW, POSE, ramp
from ecu.detection.layout import FAULTY, RAMP, STIRRED
from ecu.estimators.loads.linkage import levers
from ecu.watched import PITCH_RATE
from tests.ecu.detection.test_detection import faults, jump_of, started
from tests.ecu.machine import play

TURNING = 0.4
"""Angular acceleration with which the frame answers [rad/s2]: in one sample less than noise."""
PRESSURES = ("lift_pressure", "tilt_pressure")


def moved(name, rate, begins_s, size=1.5, turning=TURNING):
    """Faults of a machine one signal of which jumps, and whose `rate` grows from `begins_s` after that on, for 0.1 s."""
    ecu, machine = started()
    jump = size * jump_of(ecu, name)
    at = machine.tick + 30

    def growing(value, tick):
        return value + turning * min(max((tick - at) / 100 - begins_s, 0.0), 0.1)

    machine.wrong[name] = lambda value, tick: value + jump * (tick >= at)
    machine.wrong[rate] = growing
    _, findings = play(ecu, machine, 45)
    return [(f.signals, f.mode) for f in faults(findings)]


def test_a_sample_of_the_ramp_is_no_stir():
    """Without this the tests below would not say what they say."""
    ecu, _ = started()
    assert ecu._detection._rules[STIRRED, PITCH_RATE] > TURNING * 0.01


@pytest.mark.parametrize("name", PRESSURES)
def test_a_pressure_whose_moment_pitches_the_frame_is_no_fault(name):
    assert moved(name, "pitch_rate", 0.0) == []


@pytest.mark.parametrize("name", PRESSURES)
@pytest.mark.parametrize(("size", "turning"), [(1.5, -TURNING), (-1.5, TURNING), (4.0, TURNING)])
def test_a_moment_the_other_way_or_too_small_explains_nothing(name, size, turning):
    """What raises the load pushes the nose down, and four times the jump would take several times the moment."""
    assert moved(name, "pitch_rate", 0.0, size, turning) == [((name,), Mode.RATE_OF_CHANGE)]


def test_what_lowers_the_load_lets_the_nose_up():
    assert moved("lift_pressure", "pitch_rate", 0.0, -1.5, -TURNING) == []


@pytest.mark.parametrize("name", PRESSURES)
@pytest.mark.parametrize(
    ("rate", "begins_s"), [("pitch_rate", 0.08), ("pitch_rate", -0.3), ("yaw_rate", 0.0), ("roll_rate", 0.0)]
)
def test_what_comes_too_late_ended_before_or_turns_about_another_axis_explains_nothing(name, rate, begins_s):
    assert moved(name, rate, begins_s) == [((name,), Mode.RATE_OF_CHANGE)]


@pytest.mark.parametrize("name", ["wheel_speed_2", "lift_arm_angle"])
def test_a_pitching_frame_explains_the_pressures_of_arm_and_bucket_alone(name):
    assert moved(name, "pitch_rate", 0.0) == [((name,), Mode.RATE_OF_CHANGE)]


def left_trend(samples, every):
    """What `ramp` finds sample by sample, of a signal that comes in each `every`-th cycle."""
    state, found, last, trend = initial(), [], samples[0], 0.0
    for sample in samples[1:]:
        innovation = sample - last - trend
        trend, last = trend + FOLLOW * innovation, sample
        for _ in range(every - 1):
            ramp(PITCH_RATE, 0.0, state, 0.01)
        ramp(PITCH_RATE, innovation, state, 0.01)
        found.append(state[RAMP, PITCH_RATE])
    return np.array(found)


@pytest.mark.parametrize("every", [1, 2])
def test_noise_does_not_add_up_in_a_ramp(every):
    """A sum of changes is the change from first to last: of white noise at most its own root of two, however many samples."""
    noise = np.random.default_rng(5).standard_normal(4000)
    found = left_trend(noise, every)
    assert np.std(found) < math.sqrt(2.0)
    innovations = left_trend(noise, every=1000)  # so far apart that nothing is left of the last one
    assert np.std(found) < np.std(innovations)


def test_a_gyro_that_is_known_to_be_wrong_explains_nothing():
    state = initial()
    ramp(PITCH_RATE, 0.1, state, 0.01)
    assert state[RAMP, PITCH_RATE] == pytest.approx(0.1)
    state[FAULTY, PITCH_RATE] = 1.0
    ramp(PITCH_RATE, 0.1, state, 0.01)
    assert state[RAMP, PITCH_RATE] == 0.0


def test_a_ramp_is_what_the_rate_has_gained_within_the_wait():
    """Of a steady acceleration, as much as the trend has not taken over and the memory has not lost."""
    ticks = round(EXPLAINED / 0.01)
    rate = np.concatenate([np.zeros(50), TURNING * 0.01 * np.arange(1, ticks + 1)])
    gained = left_trend(rate, 1)[-1]
    kept = sum(((1.0 - FOLLOW) ** k) * math.exp(-(ticks - 1 - k) * 0.01 / EXPLAINED) for k in range(ticks))
    assert gained == pytest.approx(TURNING * 0.01 * kept, rel=1e-9)
    assert 0.3 * TURNING * EXPLAINED < gained < TURNING * EXPLAINED


@pytest.mark.parametrize("name", ["l60", "compact"])
def test_poses_differ_by_what_a_ramp_may_explain_more(name):
    """What lift and tilt pressure show of a load on the pin, over its moment about the front axle: within POSE of the middle, and no less than half of it."""
    p = load_calibration(name).parameters
    shown = []
    for angle in np.radians(np.linspace(-35.0, 45.0, 17)):
        lift, tilt, _ = levers(angle, 0.7, p.arm, p.bucket, p.cylinders, p.tilt_linkage)
        reach = p.arm.length * math.cos(angle)
        moment = p.arm.pivot_x + reach - p.geometry.front_length
        shown.append((reach / lift / moment, p.bucket.forward / tilt / moment))
    spread = np.ptp(np.log(shown), axis=0) / 2.0
    assert np.all(spread < math.log(POSE))
    assert spread.max() > math.log(POSE) / 2.0
