"""What a residual's equation leaves out is in its bound: gain errors, other times, slip; where it does not hold, it is silent."""

import math

import numpy as np
import pytest

from dbc import loader_database
from ecu.calibration import load_calibration
from ecu.detection.detector import columns, initial
from ecu.detection.layout import (
    ANGLE_RATE,
    BUCKET_LOAD,
    PITCH_GYRO,
    RESIDUALS,
    ROLL_GYRO,
    SPEEDS,
    TOLERANCE,
    TRACTION,
    YAW_STEERING,
)
from ecu.detection.machine import NOTHING, machine_mass
from ecu.detection.motion import SLIPPERY, slip_of
from ecu.detection.residuals import FORGOTTEN
from ecu.detection.rules import rules_array
from ecu.estimators.parameters import GRAVITY
from ecu.watched import (
    ANGLE,
    COUNT,
    FORCE,
    MESSAGES,
    NAMES,
    PITCH,
    PITCH_RATE,
    PLACE,
    RATE,
    ROLL,
    ROLL_RATE,
    TORQUE,
)  # fmt: skip
from tests.ecu.detection.test_detection import ROLLING
from tests.ecu.machine import STANDING

CALIBRATION = load_calibration()
TOLERANCES = CALIBRATION.detection.tolerances
TICKS = 2000
TIME = np.arange(TICKS) / 100.0
WARM = 150  # ticks in which the observers are held
STILL = np.array([(STANDING | ROLLING | {"slope_pitch_rate": 0.0})[name] for name in NAMES])


def judged(rows, tolerances=TOLERANCES):
    """Residuals and bounds of every cycle, without the bounds' constant part; no test fires, which would reset the observers."""
    database = loader_database()
    cycles = {
        name: database.by_name[message].cycle_ns / 1e7 for name, message in zip(NAMES, MESSAGES, strict=True)
    }
    rules = rules_array(CALIBRATION.detection, cycles, CALIBRATION.parameters)
    rules[TOLERANCE] = 0.0
    numbers = list(dict.fromkeys(MESSAGES))
    message = np.array([numbers.index(name) for name in MESSAGES])
    n = len(rows)
    modes, thresholds = np.zeros((n, COUNT), np.int64), np.zeros((n, COUNT))
    r, bound = np.zeros((2, n, RESIDUALS))
    columns(
        rows, np.ones((n, COUNT), np.int64), np.ones((n, COUNT)), message, CALIBRATION.parameters, tolerances, rules,
        1e12, initial(), modes, thresholds, r, bound,
    )  # fmt: skip
    return r, bound


def steering(hertz, rate):
    """Angle and rate of a joint that swings at full speed."""
    turn = 2.0 * math.pi * hertz
    return rate / turn * (1.0 - np.cos(turn * TIME)), rate * np.sin(turn * TIME)


PAIRS = [(ANGLE_RATE, ANGLE, RATE), (ROLL_GYRO, ROLL, ROLL_RATE), (PITCH_GYRO, PITCH, PITCH_RATE)]


@pytest.mark.parametrize(("residual", "angle", "rate"), PAIRS)
@pytest.mark.parametrize("hertz", [0.02, 0.1, 0.5, 2.0])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_gain_error_within_tolerance_stays_in_the_bound_at_any_rate(residual, angle, rate, hertz, sign):
    # an inclination sensor reads 60 degrees at most
    angles, rates = steering(hertz, min(math.radians(8.0), math.radians(30.0) * 2.0 * math.pi * hertz))
    rows = np.tile(STILL, (TICKS, 1))
    rows[:, angle], rows[:, rate] = angles, rates * (1.0 + 0.98 * sign * TOLERANCES.gain)
    # of one time: the rate over the tick that has just passed, as the observer adds it up
    rows[1:, angle] = np.cumsum(rates[1:]) * 0.01
    rows[0, angle] = 0.0
    r, bound = judged(rows, TOLERANCES._replace(time=0.0))
    assert np.abs(r[WARM:, residual]).max() > 1e-4
    assert (np.abs(r[WARM:, residual]) <= bound[WARM:, residual] + 1e-12).all()


@pytest.mark.parametrize(("residual", "angle", "rate"), PAIRS)
@pytest.mark.parametrize("hertz", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("late", [-2, 1, 2])
def test_samples_of_another_time_stay_in_the_bound(residual, angle, rate, hertz, late):
    _, rates = steering(hertz, math.radians(8.0))
    rows = np.tile(STILL, (TICKS, 1))
    rows[1:, angle] = np.cumsum(rates[1:]) * 0.01
    rows[0, angle] = 0.0
    rows[:, rate] = np.interp(TIME - 0.01 * late, TIME, rates)
    r, bound = judged(rows, TOLERANCES._replace(gain=0.0))
    # the observers were set to the angle while the rate was not zero: that is forgotten first
    later = slice(WARM + 1000, None)
    assert np.abs(r[later, residual]).max() > 1e-4
    assert (np.abs(r[later, residual]) <= 1.02 * bound[later, residual] + 1e-6).all()


@pytest.mark.parametrize("used", [0.01, 0.1, 0.2, 0.34])
def test_slip_gives_the_force_that_it_was_computed_for(used):
    """The brush model forwards: F = mu (1 - (1 - C s / 3 mu)^3)."""
    stiffness = 7.5
    slip = slip_of(used, stiffness)
    left = 1.0 - stiffness * slip / (3.0 * SLIPPERY)
    assert SLIPPERY * (1.0 - left**3) == pytest.approx(used)
    assert slip >= used / stiffness


def test_wheels_near_their_limit_say_nothing_until_filters_have_forgotten():
    rows = np.tile(STILL, (800, 1))
    rows[300:400, TORQUE] = 14e3  # as much as its brake gives: no road is sure to hold it
    _, bound = judged(rows)
    silent = (bound[:, SPEEDS : YAW_STEERING + 1] >= NOTHING).all(axis=1)
    assert not silent[200:300].any()
    assert silent[301 : 399 + round(100 * FORGOTTEN)].all()
    assert not silent[700:].any()


def test_a_pile_silences_traction_and_pressures_but_only_ahead():
    rows = np.tile(STILL, (600, 1))
    rows[300:400, TORQUE : TORQUE + 4] = 2e3
    _, bound = judged(rows)
    assert (bound[350:400, [TRACTION, BUCKET_LOAD]] >= NOTHING).all()
    rows[300:400, TORQUE : TORQUE + 4] = 0.0
    rows[300:400, FORCE] = 1e4 / machine_mass(
        CALIBRATION.parameters
    )  # pushed without torque: no pile does that
    _, bound = judged(rows)
    assert (bound[350:400, TRACTION] < NOTHING).all()


def levelled(pitch, ahead, dt=0.01, time=1.0):
    """Readings of an inclination sensor on a frame of this pitch whose accelerometers feel `ahead`: lean' = (shown - pitch - lean) / time."""
    shown = np.arctan2(-(ahead - GRAVITY * np.sin(pitch)), GRAVITY * np.cos(pitch))
    readings, lean = np.empty_like(pitch), 0.0
    for i in range(len(pitch)):
        lean += dt / (time + dt) * (shown[i] - pitch[i] - lean)
        readings[i] = pitch[i] + lean
    return readings


def shaken(swing, begin=300, hertz=1.7, nod=0.05):
    """A machine that rolls evenly while its frame nods, and is pushed ahead by `swing` m/s2 in the rhythm, from a tick on."""
    turn = 2.0 * math.pi * hertz
    on = np.arange(TICKS) >= begin
    since = TIME - begin / 100.0
    pitch = np.where(on, nod * (1.0 - np.cos(turn * since)) / 2.0, 0.0)
    rate = np.where(on, nod * turn * np.sin(turn * since) / 2.0, 0.0)
    ahead = np.where(on, swing * np.sin(turn * since) * np.exp(-np.maximum(since, 0.0) / 2.0), 0.0)
    rows = np.tile(STILL, (TICKS, 1))
    rows[:, PITCH], rows[:, PITCH_RATE] = levelled(pitch, ahead), rate
    rows[:, PLACE["slope_pitch_rate"]] = rate
    rows[:, FORCE] = ahead - GRAVITY * np.sin(pitch)
    rows[:, FORCE + 2] = GRAVITY * np.cos(pitch)
    return rows


@pytest.mark.parametrize("swing", [-6.0, 3.0, 6.0])
def test_a_slope_sensor_that_is_shaken_is_not_wrong(swing):
    """Its accelerometers feel what no wheel shows: the wheels roll on as before."""
    rows = shaken(swing)
    r, bound = judged(rows)
    assert np.degrees(rows[:, PITCH] - rows[0, PITCH]).max() > 2.0
    assert (np.abs(r[WARM:, PITCH_GYRO]) <= bound[WARM:, PITCH_GYRO] + 1e-9).all()


@pytest.mark.parametrize("grade", [0.0, 2.0, 10.0])
def test_a_slow_push_that_no_wheel_shows_stays_in_the_bound(grade):
    """Locked wheels or wheels in the air: up to 1 m/s2 for three seconds, which the wheels do not see."""
    begin, end = 600, 900
    ahead = np.zeros(TICKS)
    # no step, which would be a jump of the accelerometer
    ahead[begin:end] = -1.0 * np.sin(np.pi * np.arange(end - begin) / (end - begin)) ** 2
    pitch = np.full(TICKS, math.radians(grade))
    rows = np.tile(STILL, (TICKS, 1))
    rows[:, PITCH] = levelled(pitch, ahead)
    rows[:, FORCE], rows[:, FORCE + 2] = ahead - GRAVITY * np.sin(pitch), GRAVITY * np.cos(pitch)
    r, bound = judged(rows)
    r, bound = r[begin:, PITCH_GYRO], bound[begin:, PITCH_GYRO]
    assert np.abs(r).max() > math.radians(0.3)
    assert (np.abs(r) <= bound + 1e-9).all()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_drifting_slope_leaves_its_bound_within_two_seconds(sign):
    """The bound must not take the fault itself for a motion of the machine."""
    rows = np.tile(STILL, (TICKS, 1))
    begin = 1200
    drift = math.radians(1.0) * np.maximum(TIME - begin / 100.0, 0.0)
    rows[:, PITCH] += sign * drift
    r, bound = judged(rows)
    within = slice(begin, begin + 200)
    beyond = np.abs(r[within, PITCH_GYRO]) - bound[within, PITCH_GYRO]
    # at least what an observer alone would show of it: 1 deg/s times its memory, less the third that is taken for motion
    assert beyond.max() > math.radians(0.6)
