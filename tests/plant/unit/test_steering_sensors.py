"""Pressures of the steering cylinders as the bus carries them: those of the truth, and together the joint's torque."""

import math
from dataclasses import replace

import cantools
import numpy as np
import pytest

from plant.sheets.machine import load_machine
from plant.unit.equipment import load_equipment
from plant.unit.profile import Profile
from plant.unit.scenario import load_scenario
from plant.unit.unit import TICK_NS, PlantUnit
from tests.plant.physics.test_steering import length
from tests.plant.unit.test_unit import DBC_FOLDER

MESSAGE = cantools.database.load_file(DBC_FOLDER / "loader.dbc").get_message_by_name("SteeringPressures")
NOISE = math.sqrt(25e3**2 + 10e3**2 / 12 + 2e3**2 / 12)
"""Of one reading [Pa]: the sensor's noise and step, and the step of the DBC."""
SCALE = 0.0025  # of the sensor
STANDARD = 4.0  # deviations that pass for chance


def pushed(name, side):
    """A braked machine that has steered on the spot and stands against its tyres' scrub: angle, true torque (n), true pressures and readings (n, 2).

    The scrub fades slowly, so that each reading has its own truth; the sensor's lag of 5 ms is nothing to that.
    """
    base = load_scenario("standstill")
    stick = Profile(((0.0, 0.2 * side), (1.0, 0.2 * side), (1.0, 0.0)))
    scenario = replace(
        base, equipment=load_equipment(name), script=replace(base.script, articulation_rate=stick)
    )
    unit = PlantUnit(load_machine(name), scenario, seed=3, obey_limits=False)
    torques, pressures, readings = [], [], []
    for tick in range(600):
        found = [f.data for f in unit.tick(tick * TICK_NS) if f.identifier == MESSAGE.frame_id]
        if tick >= 200 and found:
            decoded = MESSAGE.decode(found[0], decode_choices=False)
            torques.append(unit.truth.joint_torque)
            pressures.append(unit.truth.steering_pressure)
            readings.append((1e3 * decoded["LeftLine"], 1e3 * decoded["RightLine"]))
            assert decoded["LeftLineState"] == decoded["RightLineState"] == 0
    return unit.truth.articulation_angle, np.array(torques), np.array(pressures), np.array(readings)


@pytest.mark.parametrize("name", ["l60", "compact"])
@pytest.mark.parametrize("side", [1, -1])
def test_a_standing_push_arrives_within_noise_and_makes_up_the_joints_torque(name, side):
    """Torque by virtual work: each cylinder's force times its change of length, from the machine file."""
    angle, torques, pressures, readings = pushed(name, side)
    at_most = STANDARD * NOISE / math.sqrt(len(readings))
    error = readings - (1 + SCALE) * pressures
    np.testing.assert_allclose(error.mean(0), 0.0, atol=at_most)
    np.testing.assert_allclose(error.std(0), NOISE, rtol=0.2)  # 200 readings: 5 % is one deviation

    steering, h = load_machine(name).steering, 1e-6
    head = math.pi / 4 * steering.bore**2
    rod = head - math.pi / 4 * steering.rod**2
    stretch = {
        cylinder: (length(steering, angle + h, cylinder) - length(steering, angle - h, cylinder)) / (2 * h)
        for cylinder in (1, -1)
    }
    to_left, to_right = readings.mean(0)
    torque = stretch[1] * (to_right * head - to_left * rod) + stretch[-1] * (to_left * head - to_right * rod)
    per_pressure = (head + rod) * max(map(abs, stretch.values()))
    assert torque * side > 0.0
    assert torque == pytest.approx(torques.mean() * (1 + SCALE), abs=math.sqrt(2) * per_pressure * at_most)
    assert abs(to_left - to_right) > 1e6
