"""Largest payload and largest tilt of a standing machine before a wheel leaves the ground."""

import math
from collections.abc import Callable
from dataclasses import replace

from plant.physics.surface import Surface
from plant.plant import Plant
from plant.sheets.machine import Machine
from studies.standards.check import Array

# Relative accuracy at which the secant method ends. Closer to lift-off, hard tyres carry so little that no equilibrium is found.
NEAR = 3e-3
HOLDING = 2.0  # friction coefficient of the tilt table: the machine must tip before it slides
FIRST_SLOPES = (0.10, 0.15)  # tangents of the first two banks


def rigid(machine: Machine) -> Machine:
    """The machine on hard tyres with the radius at which the machine file gives its heights."""
    hard = replace(
        machine.tyre,
        # on hard tyres nothing is compressed: the radius has to be the height of the wheel's centre under load
        radius=machine.geometry.wheel_centre_height,
        qfz1=1000.0 * machine.tyre.qfz1,
        qfz2=0.0,
    )
    return replace(machine, tyre=hard)


def rear_load(machine: Machine, articulation: float, payload: float) -> Array:
    """Normal force of both rear wheels together [N], (1,), with the arm level: the bucket at its largest reach."""
    plant = Plant(machine, payload_mass=payload, articulation_angle=articulation, lift_arm_angle=0.0)
    # a plant starts in equilibrium: no time has to pass
    return plant.truth().normal_force[2:].sum(keepdims=True)


def tipping_load(machine: Machine, articulation: float) -> float:
    """Payload at which the rear wheels leave the ground, arm level [kg]. articulation [rad]."""
    rated = machine.payload.reference_mass
    return first_zero(lambda load: rear_load(machine, articulation, load), 0.5 * rated, rated)


def lift_off_slope(
    machine: Machine, articulation: float, payload: float, lift: float | None, side: int
) -> float:
    """Tangent of the bank at which the first wheel lifts; side +1: left side of the rear frame uphill.

    The machine stands on its brakes: a tilt table. articulation, lift [rad]; payload [kg].
    """

    def loads(slope: float) -> Array:
        surface = Surface(friction=HOLDING, bank=side * math.atan(slope))
        return (
            Plant(
                machine,
                surface,
                payload_mass=payload,
                articulation_angle=articulation,
                lift_arm_angle=lift,
            )
            .truth()
            .normal_force
        )

    return first_zero(loads, *FIRST_SLOPES)


def first_zero(loads: Callable[[float], Array], first: float, second: float) -> float:
    """The argument at which the first of several loads reaches zero. Raises ArithmeticError if it is not found.

    loads: decreasing functions of the argument, (n,) [N]; first, second: two arguments before the zero.
    """
    # A secant method that takes only 85 % of each step, so that it approaches from one side: beyond the zero the machine has no equilibrium.
    a, at_a, b, at_b = first, loads(first), second, loads(second)
    for _ in range(30):
        # loads that rise have no zero ahead; of the others the first zero decides
        falling = at_b < at_a
        zero = float((b + at_b[falling] * (b - a) / (at_a - at_b)[falling]).min())
        if abs(zero - b) < NEAR * abs(zero):
            return zero
        a, at_a, b = b, at_b, b + 0.85 * (zero - b)
        at_b = loads(b)
    raise ArithmeticError(f"no wheel's load reached zero near {zero:g}")
