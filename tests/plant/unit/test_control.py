"""The rules of driver, limits and actuators compiled into one call: the same numbers as in Python, whatever comes in."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from plant.physics.state import COMMANDS
from plant.sheets.machine import load_machine
from plant.unit.actuators import abilities_of
from plant.unit.control import Fitted, control
from plant.unit.equipment import load_equipment
from plant.unit.limits import Limits, LinkageLimits
from plant.unit.profile import Profile, Sine
from plant.unit.script import Script
from plant.unit.signals import CHANNELS, OWN

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
    fitted = Fitted(script.curves, EQUIPMENT.driver, ABILITIES, EQUIPMENT.obedience, EQUIPMENT.rolling_radius)
    found = []
    for function in (control, control.py_func):
        kept, command = np.array(own), np.empty(COMMANDS)
        finite = function(time, STEP, np.array(read), given_limits, age, linkage_age, fitted, kept, command)
        found.append((finite, kept.tobytes(), command.tobytes()))
        assert finite == np.isfinite(command).all()
    assert found[0] == found[1]
