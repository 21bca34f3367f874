"""From what the machine reads and its driver wants to the commands to its actuators, in one compiled call per tick.

The rules are those of `plant.unit.driver`, `plant.unit.actuators` and `plant.unit.limits`, in their order:

    the script's wish, the driver's pedals and joystick, what full demand means, the limits in force, the power of the motors
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plant.compiled import uncounted
from plant.physics.state import COMMANDS
from plant.unit.actuators import Abilities, request_of, within_power
from plant.unit.driver import Demand, DriverParameters, DriverState, drive
from plant.unit.limits import Limits, Obedience, holds_back, in_force, obey
from plant.unit.profile import Curves
from plant.unit.script import wish_at
from plant.unit.signals import HELD_BACK, INDEX, INTEGRAL, WHEEL_SPEED, family_slice

Floats = NDArray[np.float64]

DEMAND: Final = len(Demand._fields)

_ANGLE: Final = INDEX["articulation_angle"]
_WHEELS: Final = family_slice(WHEEL_SPEED).start


class Fitted(NamedTuple):
    """What does not change during a run."""

    script: Curves
    driver: DriverParameters
    abilities: Abilities
    obedience: Obedience
    rolling_radius: float  # [m]


@uncounted
def ground_speed(readings: Floats, rolling_radius: float) -> float:
    """The speed that the machine measures, from the mean of its wheels [m/s]."""
    total = readings[_WHEELS] + readings[_WHEELS + 1] + readings[_WHEELS + 2] + readings[_WHEELS + 3]
    return total / 4 * rolling_radius


@uncounted
def control(
    time: float,
    step: float,
    readings: Floats,
    limits: Limits,
    age: float,
    linkage_age: float,
    fitted: Fitted,
    own: Floats,
    command: Floats,
) -> bool:
    """One tick, from the last `readings` at `time` [s]: what the driver does is kept in `own`, what the actuators shall do goes to `command`.

    Returns whether all commands are finite, which readings that are not would spoil. limits, age, linkage_age: as of `limits.in_force`; command: in the order of `Commands.vector`.
    """
    speed = ground_speed(readings, fitted.rolling_radius)
    state = DriverState(Demand(own[0], own[1], own[2], own[3], own[4]), own[INTEGRAL])
    wish = wish_at(fitted.script, time, step)
    state = drive(state, fitted.driver, wish, speed, readings[_ANGLE], step, own[HELD_BACK] != 0.0)
    demanded = request_of(state.demand, fitted.abilities)
    limits = in_force(limits, age, linkage_age, fitted.obedience)
    request = obey(demanded, limits, fitted.obedience, fitted.abilities, speed)
    for i in range(DEMAND):
        own[i] = state.demand[i]
    own[INTEGRAL] = state.integral
    own[HELD_BACK] = 1.0 if holds_back(demanded, request) else 0.0
    wheels = readings[_WHEELS], readings[_WHEELS + 1], readings[_WHEELS + 2], readings[_WHEELS + 3]
    request = within_power(request, wheels, fitted.abilities.drive_power)
    for i in range(4):
        command[i] = request.wheel_torque[i]
        command[4 + i] = request.brake_torque[i]
    command[8], command[9], command[10] = request.articulation_rate, request.lift_rate, request.tilt_rate
    total = 0.0
    for i in range(COMMANDS):
        total += command[i]
    return math.isfinite(total)
