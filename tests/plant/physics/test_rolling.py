"""A rolling start is in balance: no wheel unloads by itself, and the tyres carry what slope and turn demand."""

import math

import numpy as np
import pytest

from plant.physics.equilibrium import NoEquilibriumError
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine

L60 = load_machine("l60")
GRAVITY = 9.81
TURNS = [  # speed [m/s], articulation and bank [deg]
    (3.0 / 3.6, 0.0, 13.5),
    (3.0, 0.0, 8.0),
    (3.0, 20.0, 0.0),
    (-2.0, -30.0, 4.0),
]


def rolling(speed, articulation, bank, **more):
    return Plant(
        L60,
        Surface(bank=math.radians(bank)),
        speed=speed,
        articulation_angle=math.radians(articulation),
        **more,
    )


@pytest.mark.parametrize(("speed", "articulation", "bank"), TURNS)
def test_loads_stay_as_they_start(speed, articulation, bank):
    plant = rolling(speed, articulation, bank)
    start = plant.truth()
    weight = start.normal_force.sum()
    for _ in range(30):
        plant.advance(Commands(), 0.01)
        assert np.abs(plant.truth().normal_force - start.normal_force).max() < 0.01 * weight


@pytest.mark.parametrize("bank", [8.0, -8.0])
def test_on_a_bank_the_tyres_carry_the_slope(bank):
    truth = rolling(3.0, 0.0, bank).truth()
    slope = math.radians(bank)
    weight = truth.normal_force.sum() / math.cos(slope)
    assert abs(truth.lateral_force.sum()) == pytest.approx(weight * math.sin(abs(slope)), rel=0.01)


def test_on_level_ground_the_tyres_turn_the_machine():
    truth = rolling(3.0, 20.0, 0.0).truth()
    across = truth.cog_specific_force[1]
    assert across == pytest.approx(
        truth.speed * truth.angular_velocity[2], rel=0.1
    )  # centripetal, to the place of the centre
    assert truth.yaw_moment == pytest.approx(0.0, abs=200.0)  # of moments of some 20 kN m of each axle


def test_a_mirrored_start_has_mirrored_loads():
    left, right = rolling(3.0, 20.0, 6.0).truth(), rolling(3.0, -20.0, -6.0).truth()
    assert left.normal_force == pytest.approx(right.normal_force[[1, 0, 3, 2]], rel=1e-6)


def test_a_straight_start_on_level_ground_needs_no_side_slip():
    truth = rolling(5.0, 0.0, 0.0).truth()
    assert np.all(truth.lateral_force == 0.0)
    assert np.all(truth.slip_angle == 0.0)


def test_a_turn_that_the_tyres_cannot_hold_is_refused():
    with pytest.raises(NoEquilibriumError, match=r"cannot roll steadily at 11\.00 m/s with 38"):
        rolling(11.0, 38.0, 0.0)
