"""Permitted articulation rate and speed: the largest that keep the roll-over margin now and while the machine slows down.

A limit does not act at once: brakes and slope bound the deceleration, and the machine goes on turning meanwhile. On a
slope, a turn that is safe now may point its outer side downhill two seconds later. A turn is therefore judged at every
heading that it reaches within `turn_ahead`, at the speed that is left there. ISO 8855, rear frame axes.
"""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.loads.normal_force import normal_forces
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.stability.prediction import PredictionState, predict, with_demand
from ecu.estimators.stability.rollover import LoadedMachine, margin, steady_loads, steady_rate
from ecu.estimators.tyres.contact import Tilt, tilt_of

TURN_STEP = 0.5
"""Time between two judged headings [s]: at 0.3 g and 10 km/h the machine turns by 30 degrees in it."""
LEANING = 2
"""Iterations for the lean of a steady turn, which depends on the loads that it changes: each leaves a fifth of the error."""


TRANSIENT = 0.05
"""Margin that a recovering rate may cost on its way: turning back accelerates the front unit sideways."""
BETTER = 0.005
"""Margin that a recovering rate has to gain in the end: more than the rounding of margins."""
RECOVERY_RATES = 4
"""Rates tried for recovery: the largest, a half, a quarter and an eighth of it."""


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
def steady_forces(
    speed: float, articulation_angle: float, ground: Vector, machine: LoadedMachine
) -> NormalForces:
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
def least_margin(
    floor: float, speed: float, articulation_angle: float, ground: Vector, machine: LoadedMachine
) -> float:
    """Smallest margin of a turn begun at `speed` [m/s, reverse negative] while the machine slows down.

    It slows down by `braking`, uphill by more and downhill by less. No heading is looked at after one below `floor`.
    """
    prediction, grip = machine.prediction, machine.wheel.lateral_peak
    direction = 1.0 if speed >= 0.0 else -1.0
    here, least = ground, 1e9
    for _ in range(int(prediction.turn_ahead / TURN_STEP + 0.5) + 1):
        forces = steady_forces(speed, articulation_angle, here, machine)
        least = min(least, margin(forces, machine.standing).ratio)
        if least < floor:
            return least
        turn = steady_rate(speed, articulation_angle, grip, machine.geometry) * TURN_STEP
        slower = max(prediction.braking + direction * here.x, 0.0) * TURN_STEP
        speed = direction * max(abs(speed) - slower, 0.0)
        here = turned_gravity(here, turn)
    return least


@compiled
def stays_above(
    floor: float, speed: float, articulation_angle: float, ground: Vector, machine: LoadedMachine
) -> bool:
    """Whether a turn begun at `speed` [m/s, reverse negative] keeps the margin `floor` while the machine slows down."""
    return least_margin(floor, speed, articulation_angle, ground, machine) >= floor


@compiled
def turned_to(start: PredictionState, rate: float, machine: LoadedMachine) -> float:
    """Articulation angle [rad] after the time that a limit holds, at this rate."""
    stop = machine.geometry.articulation_stop
    return min(max(start.articulation_angle + rate * machine.prediction.limit_hold, -stop), stop)


@compiled
def keeps_margins(start: PredictionState, rate: float, machine: LoadedMachine) -> bool:
    """Whether the articulation rate [rad/s] keeps `margin_floor` over the horizon, and `turn_floor` in the turn that follows."""
    prediction = machine.prediction
    ahead = predict(with_demand(start, rate), prediction.limit_hold, prediction.margin_floor, machine)
    return ahead.margin > prediction.margin_floor and stays_above(
        prediction.turn_floor, start.speed, turned_to(start, rate, machine), start.ground, machine
    )


@compiled
def helps(start: PredictionState, rate: float, machine: LoadedMachine) -> bool:
    """Whether the articulation rate [rad/s] brings the machine further from roll-over than holding the angle does.

    The loads at the end of the limit's hold have to be better, and those of the turn that follows; on the way the margin
    may fall no further than `TRANSIENT` below what holding the angle leaves.
    """
    hold, none = machine.prediction.limit_hold, -1e9
    moved = predict(with_demand(start, rate), hold, none, machine)
    held = predict(with_demand(start, 0.0), hold, none, machine)
    if moved.margin < held.margin - TRANSIENT:
        return False
    angle, ground, speed = start.articulation_angle, start.ground, start.speed
    after_move = least_margin(none, speed, turned_to(start, rate, machine), ground, machine)
    after_hold = least_margin(none, speed, angle, ground, machine)
    return after_move > after_hold + BETTER


@compiled
def permitted_rate(start: PredictionState, machine: LoadedMachine) -> float:
    """Largest articulation rate [rad/s] in the demanded direction that keeps the margins, found to 1/64 of the machine's largest.

    Without a demand the direction that tightens the turn is taken. Where even holding the angle violates a floor, a
    rate that helps is permitted, and no other: to refuse it would keep the machine where it is about to tip over.
    """
    direction, high = demanded_direction(start), machine.prediction.largest_rate
    if keeps_margins(start, direction * high, machine):
        return high
    if not keeps_margins(start, 0.0, machine):
        for k in range(RECOVERY_RATES):
            rate = high / 2.0**k
            if helps(start, direction * rate, machine):
                return rate
        return 0.0
    low = 0.0
    for _ in range(6):
        trial = (low + high) / 2.0
        if keeps_margins(start, direction * trial, machine):
            low = trial
        else:
            high = trial
    return low


@compiled
def demanded_direction(start: PredictionState) -> float:
    """+1 to the left, -1 to the right; without a demand the direction that tightens the turn."""
    tighten = start.articulation_angle >= 0.0
    return 1.0 if start.demanded_rate > 0.0 or (start.demanded_rate == 0.0 and tighten) else -1.0


@compiled
def permitted_speed(
    articulation_angle: float, ground: Vector, direction: float, machine: LoadedMachine
) -> float:
    """Largest speed [m/s] from which a turn at this angle keeps `speed_floor`, found to 1/256 of the machine's largest.

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
def limit_for(permitted: float, ground: Vector, direction: float, machine: LoadedMachine) -> float:
    """The speed limit [m/s] that brings the machine to the permitted speed.

    The machine brakes only as far as it is above its limit; downhill it needs that to stay where it is. Where any
    speed is permitted nothing is limited.
    """
    if permitted >= machine.prediction.largest_speed:
        return permitted
    downhill = max(-direction * ground.x, 0.0)
    return max(permitted - machine.prediction.braking_slack * downhill, 0.0)
