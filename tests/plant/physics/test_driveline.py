"""Four motors, or a shaft between the axles: what each shares, and the balance of torque and power."""

from dataclasses import replace

import numpy as np
import pytest

from configuration import ConfigurationError
from plant.physics import state as s
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine

L60, SHAFT = load_machine("l60"), load_machine("l60_shaft")
COMPACT = load_machine("compact", [(("driveline", "layout"), "shaft")])
AHEAD = Commands(wheel_torque=(4e3, 1e3, 2e3, 3e3))


def axles(wheel_speed):
    return wheel_speed[:2].mean() - wheel_speed[2:].mean()


@pytest.mark.parametrize("machine", [SHAFT, COMPACT])
def test_a_shaft_makes_both_axles_turn_alike(machine):
    """In a turn of unequal tyres and, on the compact machine, unequal halves, the wheels' slips give way instead."""
    free = Plant(replace(machine, driveline=L60.driveline), speed=3.0, articulation_angle=0.5)
    tied = Plant(machine, speed=3.0, articulation_angle=0.5)
    for plant in (free, tied):
        plant.advance(Commands(), 4.0)
    free, tied = free.truth(), tied.truth()
    assert abs(axles(free.wheel_speed)) > 0.004 * abs(free.wheel_speed.mean())
    assert abs(axles(tied.wheel_speed)) < 1e-3 * abs(tied.wheel_speed.mean())
    assert tied.slip[:2].mean() * tied.slip[2:].mean() < 0.0, "one axle drives, the other brakes"
    assert tied.longitudinal_force[:2].sum() * tied.longitudinal_force[2:].sum() < 0.0


def test_open_differentials_share_equally_and_the_shaft_takes_from_one_axle_what_it_gives_the_other():
    plant = Plant(SHAFT, Surface(grade=0.1), speed=2.0, articulation_angle=0.4)
    plant.advance(AHEAD, 1.0)
    torque, motors = plant.truth().wheel_torque, plant._state[s.DRIVE : s.DRIVE + 4]
    assert torque[0] == pytest.approx(torque[1], rel=1e-12)
    assert torque[2] == pytest.approx(torque[3], rel=1e-12)
    assert abs(torque[0] - torque[2]) > 100.0, "the shaft is wound up"
    assert torque.sum() == pytest.approx(10e3, rel=1e-6)
    np.testing.assert_allclose(motors, 2.5e3, rtol=1e-6)


def test_each_motor_keeps_its_own_torque():
    plant = Plant(L60, Surface(grade=0.1), speed=2.0, articulation_angle=0.4)
    plant.advance(AHEAD, 1.0)
    np.testing.assert_allclose(plant.truth().wheel_torque, AHEAD.wheel_torque, rtol=1e-6)


def test_power_at_the_wheels_is_that_of_the_source_less_what_the_shaft_stores_and_loses():
    """Over two seconds with the torque put on at once; Simpson's rule over 0.5 ms, 1e-6 of the work done."""
    plant = Plant(SHAFT, speed=2.0, articulation_angle=0.5, integrator="rk4", step_s=5e-4)
    k, c = SHAFT.driveline.stiffness, SHAFT.driveline.damping
    before, power, work = 0.5 * k * plant._state[s.SHAFT] ** 2, [], []
    for tick in range(4001):
        truth, state = plant.truth(), plant._state
        given = state[s.DRIVE : s.DRIVE + 4] @ truth.wheel_speed
        lost = c * axles(truth.wheel_speed) ** 2
        power.append(given - truth.wheel_torque @ truth.wheel_speed - lost)
        work.append(abs(given) + lost)
        if tick < 4000:
            plant.advance(AHEAD, 5e-4)
    into_shaft = 5e-4 / 3 * (power[0] + power[-1] + 4 * sum(power[1:-1:2]) + 2 * sum(power[2:-1:2]))
    stored = 0.5 * k * plant._state[s.SHAFT] ** 2 - before
    assert abs(stored) > 0.0
    assert into_shaft == pytest.approx(stored, abs=1e-6 * 5e-4 * sum(work))


def test_the_brakes_hold_against_a_wound_up_shaft():
    """Stopped in a turn on a slope, the machine stays: the brakes bear motor and shaft."""
    plant = Plant(SHAFT, Surface(grade=0.15), speed=2.0, articulation_angle=0.6)
    plant.advance(Commands(brake_torque=(14e3, 14e3, 11e3, 11e3)), 15.0)
    at_rest = plant.truth()
    plant.advance(Commands(brake_torque=(14e3, 14e3, 11e3, 11e3)), 20.0)
    truth = plant.truth()
    assert not truth.wheel_speed.any()
    assert np.linalg.norm(truth.position - at_rest.position) < 1e-3


def test_a_layout_that_does_not_exist_is_refused():
    with pytest.raises(ConfigurationError, match=r"driveline\.layout = 'belt' is not one of motors, shaft"):
        load_machine("l60", [(("driveline", "layout"), "belt")])
