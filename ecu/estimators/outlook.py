"""The prediction and the limits of many rows at once: `estimate.predict_and_permit` with its predictions side by side.

Where the largest rate keeps the margins, as it mostly does, a row needs up to four predictions whose starts are known beforehand. They are
made in `stability.lanes`. Where it does not, the search for the limit goes on row by row.
"""

from typing import Any, NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.estimate import Future, asked_direction, asked_of, travel, turn_ahead
from ecu.estimators.parameters import Body
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.stability import permitted, permitted_braking
from ecu.estimators.stability.lanes import predict_chosen
from ecu.estimators.stability.levers import Levers, largest, with_motion
from ecu.estimators.stability.loading import Loading, reloaded
from ecu.estimators.stability.permitted import DEEP, NONE, SPEED_STEP, SPEED_TRIALS
from ecu.estimators.stability.permitted_levers import (
    LEVER_TRIALS,
    SOON,
    helping_lever,
    leaves_ample,
    turns_after,
)
from ecu.estimators.stability.prediction import Prediction, with_demand, with_levers
from ecu.estimators.stability.rollover import LoadedMachine
from ecu.estimators.stability.search import goes_on, narrowed, next_trial, over
from ecu.estimators.stability.steady import steady_turns
from ecu.estimators.stability.step import PredictionState
from ecu.estimators.stability.turn_lanes import least_margins

Rows = Any
"""A list with an entry for each row; numba's own lists have no types that Python knows."""
NOTHING = Prediction(0.0, 0.0, 0.0, 0.0)
"""What a list of predictions holds before they are made."""


class Case(NamedTuple):
    """What the prediction and the limits of a row follow from."""

    start: PredictionState
    loading: Loading
    motion: float  # of the levers, the one whose limit is looked for
    rate_limit: float  # of the articulation [rad/s]


CASES = 39
"""Numbers of a Case in a row of columns."""


@inlined
def put_case(row: Rows, c: Case) -> None:
    """A case into a row of numbers."""
    s, by, levers = c.start, c.loading, c.start.levers
    front, standing = by.front, by.standing
    numbers = (
        s.articulation_angle, s.articulation_rate, s.demanded_rate, s.speed, s.acceleration, s.gravity_x, s.gravity_y,
        s.gravity_z, s.ground.x, s.ground.y, s.ground.z, s.drift, s.yaw_rate, s.front_left, s.front_right, s.rear_load,
        s.left_rate, s.right_rate, levers.lift_angle, levers.lift_rate, levers.lift_demand, levers.tilt_angle,
        levers.tilt_rate, levers.tilt_demand, front.mass, front.x, front.z, front.roll_inertia, front.pitch_inertia,
        front.yaw_inertia, standing.front_left, standing.front_right, standing.pivot, standing.rear_left,
        standing.rear_right, by.pitch_frequency, by.payload, c.motion, c.rate_limit,
    )  # fmt: skip
    for k in range(CASES):
        row[k] = numbers[k]


@inlined
def case_in(r: Rows) -> Case:
    """Its counterpart."""
    return Case(
        PredictionState(
            r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], Vector(r[8], r[9], r[10]), r[11], r[12], r[13], r[14],
            r[15], r[16], r[17], Levers(r[18], r[19], r[20], r[21], r[22], r[23]),
        ),
        Loading(
            Body(r[24], r[25], r[26], r[27], r[28], r[29]), NormalForces(r[30], r[31], r[32], r[33], r[34]), r[35], r[36],
        ),
        r[37], r[38],
    )  # fmt: skip


@compiled
def futures(cases: Rows, m: LoadedMachine) -> Rows:
    """A Future for each Case of one machine, as of `predict_and_permit`; errors as there."""
    n, rules = len(cases), m.prediction
    starts, loadings = [c.start for c in cases], [c.loading for c in cases]
    asked = [asked_of(c.start, c.rate_limit) for c in cases]
    ahead = [NOTHING for _ in cases]
    predict_chosen([True for _ in cases], asked, loadings, rules.demand_hold, 0.0, m, ahead)
    rates = permitted_rates(starts, loadings, m)
    speeds = speed_limits(asked, loadings, m)
    levers = permitted_lever_rates(asked, [int(c.motion) for c in cases], ahead, loadings, m)
    return [
        Future(ahead[k], rates[k], asked_direction(starts[k]), speeds[k], levers[k], cases[k].motion)
        for k in range(n)
    ]


@compiled
def permitted_rates(starts: Rows, loadings: Rows, m: LoadedMachine) -> Rows:
    """`permitted.permitted_rate` of each row."""
    n, rules = len(starts), m.prediction
    high = rules.largest_rate
    turned = [with_demand(s, permitted.demanded_direction(s) * high) for s in starts]
    turns = [
        steady_turns(
            permitted.turned_to(starts[k], turned[k].demanded_rate, m),
            starts[k].ground.z,
            reloaded(m, loadings[k]),
        )
        for k in range(n)
    ]
    kept = keep_turn([True for _ in range(n)], starts, turns, loadings, m)
    keep_margin(kept, turned, loadings, rules.limit_hold, m)
    return [
        high if kept[k] else permitted.searched_rate(starts[k], reloaded(m, loadings[k])) for k in range(n)
    ]


@compiled
def permitted_lever_rates(starts: Rows, motions: Rows, ahead: Rows, loadings: Rows, m: LoadedMachine) -> Rows:
    """`permitted_levers.permitted_lever` of each row; ahead: predictions without the motion."""
    n = len(starts)
    ample = [leaves_ample(starts[k], motions[k], ahead[k].margin, reloaded(m, loadings[k])) for k in range(n)]
    rates = [largest(motion, m.drive) for motion in motions]
    kept = keep_lever([not a for a in ample], starts, motions, rates, loadings, m)
    rows = [k for k in range(n) if not ample[k] and not kept[k]]
    if len(rows) > 0:
        found = searched_lever_rates(
            [starts[k] for k in rows], [motions[k] for k in rows], [loadings[k] for k in rows], m
        )
        for k in range(len(rows)):
            rates[rows[k]] = found[k]
    return rates


@compiled
def searched_lever_rates(starts: Rows, motions: Rows, loadings: Rows, m: LoadedMachine) -> Rows:
    """`permitted_levers.searched_lever` of each row: the trials of all searches side by side."""
    n, rules = len(starts), m.prediction
    every, after_rest, rested = [True for _ in starts], [0.0 for _ in starts], [NOTHING for _ in starts]
    resting = [with_levers(starts[k], with_motion(starts[k].levers, motions[k], 0.0)) for k in range(n)]
    turns = [turns_after(starts[k], resting[k].levers, reloaded(m, loadings[k])) for k in range(n)]
    least_margins(
        every, NONE, [s.speed for s in starts], turns, [s.ground for s in starts], loadings, m, after_rest
    )
    predict_chosen(every, resting, loadings, rules.limit_hold, NONE, m, rested)
    searching = [
        after_rest[k] >= rules.turn_floor and rested[k].margin > rules.margin_floor for k in range(n)
    ]
    low, high = [0.0 for _ in starts], [largest(motion, m.drive) for motion in motions]
    for _ in range(LEVER_TRIALS):
        trials = [(low[k] + high[k]) / 2.0 for k in range(n)]
        kept = keep_lever(searching, starts, motions, trials, loadings, m)
        for k in range(n):
            if kept[k]:
                low[k] = trials[k]
            else:
                high[k] = trials[k]
    return [
        low[k]
        if searching[k]
        else helping_lever(starts[k], motions[k], rested[k].margin, after_rest[k], reloaded(m, loadings[k]))
        for k in range(n)
    ]


@compiled
def keep_lever(
    chosen: Rows, starts: Rows, motions: Rows, rates: Rows, loadings: Rows, m: LoadedMachine
) -> Rows:
    """`permitted_levers.keeps_with_lever` of the chosen rows, each with its rate; False for the others."""
    n, rules = len(starts), m.prediction
    moved = [with_levers(starts[k], with_motion(starts[k].levers, motions[k], rates[k])) for k in range(n)]
    turns = [turns_after(starts[k], moved[k].levers, reloaded(m, loadings[k])) for k in range(n)]
    kept = keep_turn(chosen, starts, turns, loadings, m)
    keep_margin(kept, moved, loadings, rules.limit_hold, m)
    keep_margin(kept, moved, loadings, SOON, m)
    return kept


@compiled
def keep_margin(kept: Rows, starts: Rows, loadings: Rows, hold: float, m: LoadedMachine) -> None:
    """Of the rows that are kept, keep those whose prediction does not fall to `margin_floor`."""
    floor, found = m.prediction.margin_floor, [NOTHING for _ in starts]
    predict_chosen(kept, starts, loadings, hold, floor, m, found)
    for k in range(len(kept)):
        kept[k] = kept[k] and found[k].margin > floor


@compiled
def keep_turn(chosen: Rows, starts: Rows, turns: Rows, loadings: Rows, m: LoadedMachine) -> Rows:
    """Which of the chosen rows keep `turn_floor` in these turns."""
    floor, least = m.prediction.turn_floor, [0.0 for _ in starts]
    least_margins(
        chosen, floor, [s.speed for s in starts], turns, [s.ground for s in starts], loadings, m, least
    )
    return [chosen[k] and least[k] >= floor for k in range(len(starts))]


@compiled
def speed_limits(starts: Rows, loadings: Rows, m: LoadedMachine) -> Rows:
    """`estimate.speed_limit` of each row: the trials of all searches side by side."""
    n, rules = len(starts), m.prediction
    floor, full = rules.speed_floor, rules.largest_speed
    grounds, directions = [s.ground for s in starts], [travel(s) for s in starts]
    turns = [steady_turns(turn_ahead(starts[k], m), grounds[k].z, reloaded(m, loadings[k])) for k in range(n)]
    at_full, standing, left = [0.0 for _ in starts], [0.0 for _ in starts], [0.0 for _ in starts]
    speeds = [d * full for d in directions]
    least_margins([True for _ in starts], floor - DEEP, speeds, turns, grounds, loadings, m, at_full)
    open_ended = [at_full[k] - floor < 0.0 for k in range(n)]
    least_margins(open_ended, floor - DEEP, [0.0 for _ in starts], turns, grounds, loadings, m, standing)
    open_ended = [open_ended[k] and standing[k] - floor >= 0.0 for k in range(n)]
    searches = [over(full, standing[k] - floor, at_full[k] - floor) for k in range(n)]
    for trial in range(SPEED_TRIALS):
        going = [open_ended[k] and goes_on(searches[k], SPEED_STEP) for k in range(n)]
        trials = [
            next_trial(searches[k], SPEED_TRIALS - 1 - trial, SPEED_STEP, SPEED_STEP) if going[k] else 0.0
            for k in range(n)
        ]
        speeds = [directions[k] * trials[k] for k in range(n)]
        least_margins(going, floor - DEEP, speeds, turns, grounds, loadings, m, left)
        for k in range(n):
            if going[k]:
                searches[k] = narrowed(searches[k], trials[k], left[k] - floor)
    permitted_speeds = [
        full if at_full[k] - floor >= 0.0 else searches[k].low if standing[k] - floor >= 0.0 else 0.0
        for k in range(n)
    ]
    limits = [permitted.limit_for(permitted_speeds[k], grounds[k], directions[k], m) for k in range(n)]
    return [permitted_braking.gentle(limits[k], starts[k], reloaded(m, loadings[k])) for k in range(n)]
