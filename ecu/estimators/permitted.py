"""What is permitted: articulation rate and speed that keep a margin now, and later while the machine slows down.

A limit does not act at once: the machine slows down no faster than its brakes and the slope let it, and goes on
turning meanwhile. On a slope a turn that is safe now may point its outer side downhill two seconds later. So a turn
counts with every heading it comes to within `turn_ahead`, at the speed that is left there. ISO 8855, rear frame axes.
"""

import math

from ecu.estimators.acceleration import Vector
from ecu.estimators.compiled import compiled
from ecu.estimators.contact import Tilt, tilt_of
from ecu.estimators.normal_force import NormalForces, normal_forces
from ecu.estimators.rollover import (
    Course,
    Laden,
    demanding,
    look_ahead,
    margin,
    steady_loads,
    steady_rate,
)

TURN_STEP = 0.5
"""Headings are looked at so often [s]: at 0.3 g and 10 km/h the machine turns by 30 degrees meanwhile."""
LEANING = 2
"""How often the lean of a steady turn is found anew from the loads: a fifth of what is missing is left each time."""


@compiled
def leaned(gravity: Vector, tilt: Tilt) -> Vector:
    """The specific force of rest [m/s2] in axes that are tilted by a small angle (roll left up, pitch nose down)."""
    return Vector(gravity.x - gravity.z * tilt.pitch, gravity.y + gravity.z * tilt.roll, gravity.z)


@compiled
def turned_gravity(gravity: Vector, angle: float) -> Vector:
    """Specific force at rest once the machine has turned left by `angle` [rad] on the same slope."""
    c, s = math.cos(angle), math.sin(angle)
    return Vector(gravity.x * c + gravity.y * s, gravity.y * c - gravity.x * s, gravity.z)


@compiled
def steady_forces(speed: float, articulation_angle: float, ground: Vector, machine: Laden) -> NormalForces:
    """Normal forces of a steady turn on tyres that give way: the machine leans to its outer side and its weight with it.

    speed: [m/s], reverse negative; ground: specific force of rest in axes of the ground [m/s2].
    """
    m, gravity = machine, ground
    for k in range(LEANING + 1):
        loads = steady_loads(
            speed, articulation_angle, gravity, m.wheel.lateral_peak, m.front, m.rear, m.axle, m.geometry
        )
        forces = normal_forces(
            loads.support, articulation_angle, loads.axle_load, loads.axle_moment, m.geometry
        )
        if k < LEANING:
            gravity = leaned(ground, tilt_of(forces, articulation_angle, m.wheel, m.geometry))
    return forces


@compiled
def stays_above(
    floor: float, speed: float, articulation_angle: float, ground: Vector, machine: Laden
) -> bool:
    """Whether a turn begun at `speed` [m/s, reverse negative] keeps the margin `floor` while the machine slows down.

    It slows down by `braking`, uphill by more and downhill by less.
    """
    prediction, grip = machine.prediction, machine.wheel.lateral_peak
    direction = 1.0 if speed >= 0.0 else -1.0
    here = ground
    for _ in range(int(prediction.turn_ahead / TURN_STEP + 0.5) + 1):
        forces = steady_forces(speed, articulation_angle, here, machine)
        if margin(forces, machine.standing).ratio < floor:
            return False
        turn = steady_rate(speed, articulation_angle, grip, machine.geometry) * TURN_STEP
        slower = max(prediction.braking + direction * here.x, 0.0) * TURN_STEP
        speed = direction * max(abs(speed) - slower, 0.0)
        here = turned_gravity(here, turn)
    return True


@compiled
def keeps_margins(course: Course, rate: float, machine: Laden) -> bool:
    """Whether the articulation rate [rad/s] keeps `margin_floor` over the horizon, and `turn_floor` in the turn that follows."""
    prediction, stop = machine.prediction, machine.geometry.articulation_stop
    outlook = look_ahead(demanding(course, rate), prediction.limit_hold, prediction.margin_floor, machine)
    angle = min(max(course.articulation_angle + rate * prediction.limit_hold, -stop), stop)
    return outlook.margin > prediction.margin_floor and stays_above(
        prediction.turn_floor, course.speed, angle, course.ground, machine
    )


@compiled
def permitted_rate(course: Course, machine: Laden) -> float:
    """Largest articulation rate [rad/s] in the demanded direction that keeps the margins, to a 64th of the largest there is.

    Without a demand the direction that tightens the turn is taken. 0 where even holding the angle violates a floor.
    """
    tighten = course.articulation_angle >= 0.0
    direction = 1.0 if course.demanded_rate > 0.0 or (course.demanded_rate == 0.0 and tighten) else -1.0
    low, high = 0.0, machine.prediction.largest_rate
    if keeps_margins(course, direction * high, machine):
        return high
    for _ in range(6):
        trial = (low + high) / 2.0
        if keeps_margins(course, direction * trial, machine):
            low = trial
        else:
            high = trial
    return low


@compiled
def permitted_speed(articulation_angle: float, ground: Vector, direction: float, machine: Laden) -> float:
    """Largest speed [m/s] at which a turn at this angle may be begun, to a 256th of the largest there is: it keeps `speed_floor`.

    direction: +1 forward, -1 reverse. 0 where the machine would not keep it standing.
    """
    floor, low, high = machine.prediction.speed_floor, 0.0, machine.prediction.largest_speed
    if stays_above(floor, direction * high, articulation_angle, ground, machine):
        return high
    for _ in range(8):
        trial = (low + high) / 2.0
        if stays_above(floor, direction * trial, articulation_angle, ground, machine):
            low = trial
        else:
            high = trial
    return low


@compiled
def limit_for(permitted: float, ground: Vector, direction: float, machine: Laden) -> float:
    """The speed limit [m/s] that brings the machine to the permitted speed.

    The machine brakes only as far as it is above its limit; downhill it needs that to stay where it is. Where any
    speed is permitted nothing is limited.
    """
    if permitted >= machine.prediction.largest_speed:
        return permitted
    downhill = max(-direction * ground.x, 0.0)
    return max(permitted - machine.prediction.braking_slack * downhill, 0.0)
