"""Permitted articulation rate and speed: the largest that keep the roll-over margin now and while the machine slows down.

A limit does not act at once: brakes and slope bound the deceleration, and the machine goes on turning meanwhile. On a
slope, a turn that is safe now may point its outer side downhill two seconds later. A turn is therefore judged at every
heading that it reaches within `turn_ahead`, at the speed that is left there. ISO 8855, rear frame axes.
"""

from ecu.estimators.compiled import compiled
from ecu.estimators.quantities import Vector
from ecu.estimators.stability.prediction import predict, with_demand
from ecu.estimators.stability.rollover import LoadedMachine
from ecu.estimators.stability.search import goes_on, narrowed, next_trial, over
from ecu.estimators.stability.steady import least_margin, steady_turns
from ecu.estimators.stability.step import PredictionState

TRANSIENT = 0.05
"""Margin that recovery may cost on its way: turning back accelerates the front unit sideways, and turns between here and a better one
may be a little worse than both."""
BETTER = 0.005
"""Margin that has to be gained for a turn or a moment to be better: more than the rounding of margins."""
RECOVERY_RATES = 7
"""Rates tried for recovery: the largest, a half of it and so on to a 64th, 0.8 deg/s. A machine that rocks bears slow turning alone."""
WAY_STEP = 0.1
"""The turns on the way to a better one are judged so far apart [rad]; between them the margin changes by some hundredths."""
RATE_TRIALS = 6
"""Halvings between holding the angle and the largest rate: the limit is known to 1/64 of it.

Halvings and no quicker search: over the rate the predicted margin has dips of some hundredths, and a search by its
slope looks beyond them (in 0.3 % of the states in which the rate was limited).
"""
NONE = -1e9
"""A floor that no margin reaches: every heading of a turn, or the whole prediction, is then computed."""
SPEED_STEP, SPEED_TRIALS = 0.1 / 3.6, 11
"""Raw step of the limit's signal [m/s], and trials that find it at worst; the margin of a turn falls evenly with speed."""
DEEP = 0.15
"""Margin below its floor at which no further heading of a turn is computed. The search for the speed needs to know how far below it is."""


@compiled
def turned_to(start: PredictionState, rate: float, machine: LoadedMachine) -> float:
    """Articulation angle [rad] after the time that a limit holds, at this rate."""
    stop = machine.geometry.articulation_stop
    return min(max(start.articulation_angle + rate * machine.prediction.limit_hold, -stop), stop)


@compiled
def margin_after(floor: float, start: PredictionState, rate: float, machine: LoadedMachine) -> float:
    """Least margin of the turn that follows this articulation rate [rad/s]; floor: as of `least_margin`."""
    turns = steady_turns(turned_to(start, rate, machine), start.ground.z, machine)
    return least_margin(floor, start.speed, turns, start.ground, machine)


@compiled
def keeps_margins(start: PredictionState, rate: float, machine: LoadedMachine) -> bool:
    """Whether the articulation rate [rad/s] keeps `margin_floor` over the horizon, and `turn_floor` in the turn that follows."""
    rules = machine.prediction
    # the turn first: it costs a fifth of a prediction, and where it fails it spares one
    if margin_after(rules.turn_floor, start, rate, machine) < rules.turn_floor:
        return False
    ahead = predict(with_demand(start, rate), rules.limit_hold, rules.margin_floor, machine)
    return ahead.margin > rules.margin_floor


@compiled
def leads_out(start: PredictionState, direction: float, after_hold: float, machine: LoadedMachine) -> bool:
    """Whether turning to this side leads to a better turn, and to none on its way that is worse by TRANSIENT.

    after_hold: margin of the present turn. Not the next moment decides: on a bank the margin over the angle has a shallow
    valley, and a machine that may never get worse stays on the wrong side of it.

    A turn that violates its floor may always be left for straight ahead. One that keeps it is not what takes the margin:
    the machine rocks. Turning back from it may cost TRANSIENT, so it has to gain more.
    """
    stop, least = machine.geometry.articulation_stop, after_hold - TRANSIENT
    violated = after_hold < machine.prediction.turn_floor
    better = after_hold + (BETTER if violated else TRANSIENT)
    angle = start.articulation_angle
    for _ in range(int(2.0 * stop / WAY_STEP) + 2):
        further = min(max(angle + direction * WAY_STEP, -stop), stop)
        if further * angle < 0.0:
            further = 0.0
        if further == angle:  # the stop
            return False
        turns = steady_turns(further, start.ground.z, machine)
        left = least_margin(least, start.speed, turns, start.ground, machine)
        if left < least:
            return False
        if left > better:
            return True
        if further == 0.0:
            return violated
        angle = further
    return False


@compiled
def recovery_rate(
    start: PredictionState, direction: float, held: float, after_hold: float, machine: LoadedMachine
) -> float:
    """Largest of the tried articulation rates [rad/s] to this side that lead out of where holding the angle violates a floor; 0 if none does.

    held, after_hold: margins if the angle is held, over the horizon and in the turn that follows. A floor that holding
    violates asks for nothing, as nothing is left of it: in its place comes what holding gives. A rate that leads out may cost
    TRANSIENT of it; any other has to be better at once.
    """
    rules = machine.prediction
    least, turn_least = held + BETTER, min(rules.turn_floor, after_hold)
    if leads_out(start, direction, after_hold, machine):
        least, turn_least = min(rules.margin_floor, held) - TRANSIENT, turn_least - TRANSIENT
    for k in range(RECOVERY_RATES):
        rate = rules.largest_rate / 2.0**k
        if margin_after(turn_least, start, direction * rate, machine) >= turn_least:
            # a prediction ends where its rate is refused
            moved = predict(with_demand(start, direction * rate), rules.limit_hold, least, machine)
            if moved.margin > least:
                return rate
    return 0.0


@compiled
def permitted_rate(start: PredictionState, machine: LoadedMachine) -> float:
    """Largest articulation rate [rad/s] in the demanded direction that keeps the margins, found to 1/64 of the machine's largest.

    Without a demand the direction that tightens the turn is taken. Where even holding the angle violates a floor, a
    rate that leads out is permitted, and no other: to refuse it would keep the machine where it is about to tip over.
    """
    high = machine.prediction.largest_rate
    if keeps_margins(start, demanded_direction(start) * high, machine):
        return high
    return searched_rate(start, machine)


@compiled
def searched_rate(start: PredictionState, machine: LoadedMachine) -> float:
    """`permitted_rate` where the largest one does not keep the margins."""
    rules, direction = machine.prediction, demanded_direction(start)
    low, high = 0.0, rules.largest_rate
    # to the end, because recovery compares with them
    after_hold = margin_after(NONE, start, 0.0, machine)
    held = predict(with_demand(start, 0.0), rules.limit_hold, NONE, machine).margin
    if after_hold < rules.turn_floor or held <= rules.margin_floor:
        return recovery_rate(start, direction, held, after_hold, machine)
    for _ in range(RATE_TRIALS):
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
    """Largest speed [m/s] from which a turn at this angle keeps `speed_floor`, found to a raw step of its signal.

    direction: +1 forward, -1 reverse. 0 where the machine would not keep it standing.
    """
    rules = machine.prediction
    floor, full = rules.speed_floor, rules.largest_speed
    turns = steady_turns(articulation_angle, ground.z, machine)
    at_full = least_margin(floor - DEEP, direction * full, turns, ground, machine) - floor
    if at_full >= 0.0:
        return full
    standing = least_margin(floor - DEEP, 0.0, turns, ground, machine) - floor
    if standing < 0.0:
        return 0.0
    search = over(full, standing, at_full)
    for k in range(SPEED_TRIALS):
        if goes_on(search, SPEED_STEP):
            trial = next_trial(search, SPEED_TRIALS - 1 - k, SPEED_STEP, SPEED_STEP)
            left = least_margin(floor - DEEP, direction * trial, turns, ground, machine) - floor
            search = narrowed(search, trial, left)
    return search.low


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
