"""Which torque is wrong, by what has changed: the wheel that the other axle does not explain, when its neighbour is explained."""

import numpy as np
import pytest

from dbc import loader_database
from ecu.codes import Mode
from ecu.detection.changes import HELD, MOST_SHARE, UNKNOWN, unexplained
from ecu.detection.detector import columns, initial
from ecu.detection.isolation import SETTLED, SLACK
from ecu.detection.layout import RESIDUALS
from ecu.detection.rules import rules_array
from ecu.watched import COUNT, MESSAGES, NAMES, PLACE, TORQUE
from tests.ecu.detection.test_detection import CALIBRATION, ROLLING, faults, started
from tests.ecu.machine import STANDING, play

TICKS = 890
TIME = np.arange(TICKS) / 100.0
BEGIN = TICKS - 130
"""Within the shortest memory, HELD: what a fault did before it is taken for an offset."""
STILL = np.array([(STANDING | ROLLING | {"slope_pitch_rate": 0.0})[name] for name in NAMES])
SINCE = np.maximum(TIME - BEGIN / 100.0, 0.0)


def shares(rows):
    """What `unexplained` says of every signal after the last row. No test fires."""
    database = loader_database()
    cycles = {
        name: database.by_name[message].cycle_ns / 1e7 for name, message in zip(NAMES, MESSAGES, strict=True)
    }
    rules = rules_array(CALIBRATION.detection, cycles, CALIBRATION.parameters)
    numbers = list(dict.fromkeys(MESSAGES))
    message = np.array([numbers.index(name) for name in MESSAGES])
    n, state = len(rows), initial()
    columns(
        rows, np.ones((n, COUNT), np.int64), np.ones((n, COUNT)), message, CALIBRATION.parameters,
        CALIBRATION.detection.tolerances, rules, 1e12, state,
        np.zeros((n, COUNT), np.int64), np.zeros((n, COUNT)), np.zeros((n, RESIDUALS)), np.zeros((n, RESIDUALS)),
    )  # fmt: skip
    return np.array([unexplained(k, state) for k in range(COUNT)])


def rolling(**values):
    rows = np.tile(STILL, (TICKS, 1))
    for name, value in values.items():
        rows[:, PLACE[name]] += value
    return rows


@pytest.mark.parametrize("offset", [-1.0, 1.0])
def test_an_offset_that_was_always_there_is_no_change(offset):
    found = shares(rolling(wheel_torque_1=1e3 * offset))
    assert found[TORQUE : TORQUE + 4] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_torque_that_drifts_explains_all_but_not_its_neighbour(wheel, sign):
    found = shares(
        rolling(**{f"wheel_torque_{wheel + 1}": sign * 1.5e3 * SINCE})
    )[TORQUE : TORQUE + 4]  # fmt: skip
    beside = wheel ^ 1
    assert found[wheel] == pytest.approx(0.0, abs=1e-6)
    assert found[beside] > 2.0 * SLACK


@pytest.mark.parametrize("share", [1.0 / MOST_SHARE, 1.0, MOST_SHARE])
def test_a_drive_that_pulls_harder_explains_both_wheels(share):
    pulled = 1e3 * SINCE
    found = shares(
        rolling(wheel_torque_1=share * pulled, wheel_torque_2=share * pulled, wheel_torque_3=pulled, wheel_torque_4=pulled)
    )  # fmt: skip
    assert found[TORQUE : TORQUE + 4] == pytest.approx(0.0, abs=0.02)


def test_an_axle_that_pulls_alone_excludes_neither_wheel():
    """Wheel 1 does not explain wheel 2, nor wheel 2 wheel 1."""
    pulled = 1e3 * SINCE
    found = shares(rolling(wheel_torque_1=pulled, wheel_torque_2=pulled + 500.0 * SINCE))
    assert found[TORQUE] > SETTLED
    assert found[TORQUE + 1] > SETTLED


def test_other_signals_are_unknown():
    found = shares(rolling())
    others = [k for k in range(COUNT) if not TORQUE <= k < TORQUE + 4]
    assert (found[others] == UNKNOWN).all()


@pytest.mark.parametrize("wheel", range(1, 5))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_slow_drift_of_a_torque_is_named(wheel, sign):
    ecu, machine = started()
    play(ecu, machine, 300)
    begin, name = machine.tick, f"wheel_torque_{wheel}"
    machine.wrong[name] = lambda value, tick: value + sign * 600.0 * (tick - begin) / 100.0
    _, findings = play(ecu, machine, 250)
    first = faults(findings)[0]
    assert first.signals == (name,)
    assert first.mode is (Mode.DRIFTED_HIGH if sign > 0.0 else Mode.DRIFTED_LOW)


def test_a_drift_longer_than_the_memory_leaves_both_wheels_possible():
    """So slow that the change within the memory is small: both wheels stay possible."""
    ecu, machine = started()
    play(ecu, machine, 300)
    begin = machine.tick
    machine.wrong["wheel_torque_1"] = lambda value, tick: value + 45.0 * (tick - begin) / 100.0
    assert 45.0 * 2.0 * HELD < 200.0
    _, findings = play(ecu, machine, 2500)
    first = faults(findings)[0]
    assert first.signals == ("wheel_torque_1", "wheel_torque_2")
    assert first.mode is Mode.ROOT_CAUSE_NOT_KNOWN
