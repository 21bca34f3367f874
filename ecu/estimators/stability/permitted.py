"""Permitted articulation rate and speed: the largest that keep the roll-over margin now and while the machine slows down.

A limit does not act at once: brakes and slope bound the deceleration, and the machine goes on turning meanwhile. On a
slope, a turn that is safe now may point its outer side downhill two seconds later. A turn is therefore judged at every
heading that it reaches within `turn_ahead`, at the speed that is left there. ISO 8855, rear frame axes.
"""

from ecu.estimators.compiled import compiled
from ecu.estimators.quantities import Vector
from ecu.estimators.stability.prediction import PredictionState, predict, with_demand
from ecu.estimators.stability.rollover import LoadedMachine
from ecu.estimators.stability.steady import SteadyTurns, least_margin, steady_turns

TRANSIENT = 0.05
"""Margin that a recovering rate may cost on its way: turning back accelerates the front unit sideways."""
BETTER = 0.005
"""Margin that a recovering rate has to gain in the end: more than the rounding of margins."""
RECOVERY_RATES = 4
"""Rates tried for recovery: the largest, a half, a quarter and an eighth of it."""


@compiled
def stays_above(
    floor: float, speed: float, turns: SteadyTurns, ground: Vector, machine: LoadedMachine
) -> bool:
    """Whether a turn begun at `speed` [m/s, reverse negative] keeps the margin `floor` while the machine slows down."""
    return least_margin(floor, speed, turns, ground, machine) >= floor


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
    if ahead.margin <= prediction.margin_floor:
        return False
    turns = steady_turns(turned_to(start, rate, machine), start.ground.z, machine)
    return stays_above(prediction.turn_floor, start.speed, turns, start.ground, machine)


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
    ground, speed = start.ground, start.speed
    turned = steady_turns(turned_to(start, rate, machine), ground.z, machine)
    stayed = steady_turns(start.articulation_angle, ground.z, machine)
    after_move = least_margin(none, speed, turned, ground, machine)
    after_hold = least_margin(none, speed, stayed, ground, machine)
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
    turns = steady_turns(articulation_angle, ground.z, machine)
    if stays_above(floor, direction * high, turns, ground, machine):
        return high
    for _ in range(8):
        trial = (low + high) / 2.0
        if stays_above(floor, direction * trial, turns, ground, machine):
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
