"""The rules of driver, limits and actuators compiled into one call: the same numbers as in Python, whatever comes in."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant.physics.state import COMMANDS
from plant.sheets.machine import load_machine
from plant.unit.actuators import abilities_of
from plant.unit.control import Fitted, control
from plant.unit.equipment import load_equipment
from plant.unit.limits import UNLIMITED, Limits, LinkageLimits
from plant.unit.profile import Profile, Sine
from plant.unit.script import Script
from plant.unit.signals import CHANNELS, INTEGRAL, OWN, WHEEL_SPEED, family_slice

EQUIPMENT = load_equipment("l60")
ABILITIES = abilities_of(load_machine("l60"), EQUIPMENT.actuators)
STEP = 0.01


def line(*points):
    return Profile(points)


SCRIPTS = [
    Script(),
    Script(speed=line((0.0, 0.0), (2.0, 4.0), (2.0, -3.0), (5.0, 0.0)), lift=line((1.0, -0.5), (3.0, 0.7))),
    Script(
        torque=line((0.0, 0.8), (4.0, -1.0)),
        brake=line((3.0, 0.0), (3.0, 0.6), (4.0, 0.0)),
        articulation_rate=line((0.0, 0.4), (6.0, -0.4)),
        tilt=line((0.0, 1.0)),
    ),
    Script(
        speed=line((0.0, 0.0)),
        articulation_angle=Profile(
            ((0.0, 0.0), (1.0, 0.3)), Sine(amplitude=0.2, frequency_hz=0.7, start_s=2.0, end_s=5.0)
        ),
    ),
]


def size(high):
    """A limit: any number, none at all, or not available."""
    return st.floats(0.0, high) | st.sampled_from([math.inf, math.nan])


limits = st.builds(
    Limits,
    st.tuples(*[size(30e3)] * 4),
    size(10.0),
    size(0.5),
    st.builds(LinkageLimits, size(1.0), size(1.0), size(1.0), size(1.0)),
)
ages = st.floats(0.0, 2.0 * EQUIPMENT.obedience.stale_after)
readings = st.lists(
    st.floats(-20.0, 20.0) | st.just(math.nan), min_size=len(CHANNELS), max_size=len(CHANNELS)
)
owns = st.lists(st.floats(-1.0, 1.0), min_size=OWN, max_size=OWN)


@given(st.sampled_from(SCRIPTS), st.floats(0.0, 7.0), readings, limits, ages, ages, owns)
@settings(max_examples=300)
def test_the_compiled_tick_is_the_python_rules_bit_for_bit(
    script, time, read, given_limits, age, linkage_age, own
):
    fitted = Fitted(
        script.curves(), EQUIPMENT.driver, ABILITIES, EQUIPMENT.obedience, EQUIPMENT.rolling_radius
    )
    found = []
    for function in (control, control.py_func):
        kept, command = np.array(own), np.empty(COMMANDS)
        finite = function(time, STEP, np.array(read), given_limits, age, linkage_age, fitted, kept, command)
        found.append((finite, kept.tobytes(), command.tobytes()))
        assert finite == np.isfinite(command).all()
    assert found[0] == found[1]


def driven(script, ticks, wheel_speed, limits=UNLIMITED):
    """What the machine knows of itself and commands after so many ticks with its wheels at this speed [rad/s]."""
    fitted = Fitted(
        script.curves(), EQUIPMENT.driver, ABILITIES, EQUIPMENT.obedience, EQUIPMENT.rolling_radius
    )
    own, command, reading = np.zeros(OWN), np.empty(COMMANDS), np.zeros(len(CHANNELS))
    reading[family_slice(WHEEL_SPEED)] = wheel_speed
    for tick in range(ticks):
        control(tick * STEP, STEP, reading, limits, 0.0, 0.0, fitted, own, command)
    return own, command


def test_motors_give_no_more_than_their_power():
    """A pedal at full: at 1 rad/s the peak torque, at 9 rad/s what the power leaves of it."""
    full = Script(torque=line((0.0, 1.0)))
    peak = np.array(ABILITIES.drive_torque)
    np.testing.assert_array_equal(driven(full, 300, 1.0)[1][:4], peak)
    fast = driven(full, 300, 9.0)[1][:4]
    np.testing.assert_allclose(fast, np.minimum(peak, ABILITIES.drive_power / 9.0))
    assert (fast < peak).all()


def test_a_driver_whom_limits_hold_back_does_not_push_harder_and_harder():
    """The integral of his speed law stands still while a limit takes the torque (anti-windup), and grows without one."""
    faster = Script(speed=line((0.0, 3.0)))
    standing_limit = UNLIMITED._replace(wheel_torque=(0.0,) * 4)
    held, free = (driven(faster, 50, 3.0, limits)[0][INTEGRAL] for limits in (standing_limit, UNLIMITED))
    error = 3.0 - 3.0 * EQUIPMENT.rolling_radius
    # at the first tick he has not been held back yet
    assert held == pytest.approx(EQUIPMENT.driver.speed_integral * error * STEP)
    assert free == pytest.approx(50 * held)
