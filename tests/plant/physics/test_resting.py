"""A state carried over to a plant that differs."""

from dataclasses import replace

import numpy as np
import pytest

from plant.effects import find_effect
from plant.physics import state as s
from plant.physics.equilibrium import find_equilibrium
from plant.physics.parameters import P_NORMAL
from plant.physics.resting import REST, moved_to_rest, rest_records
from plant.physics.surface import road_axes
from plant.plant import Plant
from plant.sheets.machine import load_machine

L60 = load_machine("l60")
OTHERS = {
    "heavier": find_effect("payload_mass").of(extra_kg=700.0),
    "softer": find_effect("inflation_pressure").of(front_bar=-0.5, rear_bar=0.3),
    "on a slope": find_effect("grade").of(grade_deg=3.0, bank_deg=1.0),
}


@pytest.mark.parametrize("name", OTHERS)
def test_a_machine_that_rolls_evenly_is_moved_to_where_the_other_rolls_evenly(name):
    """The other's own equilibrium (Newton on all its equations, plant.physics.equilibrium) is the reference.

    So slow that no lateral force of the turn leans the machine, which is no part of its rest.
    """
    state, p, work, active, _ = Plant(L60, speed=0.01, articulation_angle=0.3).inside()
    records = np.empty((1, REST))
    rest_records(state[None], p, work, active, records)
    other = Plant(replace(L60, effects=(OTHERS[name],)), speed=0.01, articulation_angle=0.3)
    wanted, p, work, active, _ = other.inside()
    for first, count in ((s.VELOCITY, 5), (s.JOINT_RATE, 9), (s.TAN_ALPHA, 4)):
        wanted[first : first + count] = (
            0.0  # a steady turn on a slope needs lateral forces, its rest has none
        )
    road = road_axes(p[P_NORMAL : P_NORMAL + 3])
    find_equilibrium(wanted, p, work, active, road, heading=0.0, standing=False)
    moved = state.copy()
    moved_to_rest(moved, records[0], p, work, active)
    attitude = slice(s.ATTITUDE, s.ATTITUDE + 4)
    np.testing.assert_allclose(moved[attitude], wanted[attitude], atol=1e-3)
    assert moved[s.JOINT + s.REAR_AXLE] == pytest.approx(wanted[s.JOINT + s.REAR_AXLE], abs=1e-6)
    if name != "on a slope":  # there the reference stands elsewhere on the plane
        assert moved[s.POSITION + 2] == pytest.approx(wanted[s.POSITION + 2], abs=1e-6)
        assert abs(wanted[s.POSITION + 2] - state[s.POSITION + 2]) > 1e-4


def test_a_plant_that_does_not_differ_moves_nothing():
    state, p, work, active, _ = Plant(L60, speed=2.0, articulation_angle=0.3).inside()
    records = np.empty((1, REST))
    rest_records(state[None], p, work, active, records)
    moved = state.copy()
    moved_to_rest(moved, records[0], p, work, active)
    np.testing.assert_allclose(moved, state, atol=1e-9)
