"""Which rates of lift arm and bucket are permitted: those that keep the margins while the machine turns.

A raised load that is lowered in a turn moves ahead, and what moves ahead in a turn is carried to the outside (Coriolis): of a
loaded L60 at 17 km/h half of the inner wheel's load. Starting and stopping the arm takes weight off the front or the rear wheels. One
of the four motions is looked at in a cycle: the limits are as old as four cycles.
"""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.loads.arm_forces import ArmForces, arm_forces
from ecu.estimators.loads.cog import pose_at
from ecu.estimators.motion.arm import Turning
from ecu.estimators.stability.levers import (
    LIFT_DOWN,
    LIFT_UP,
    TILT_BACK,
    Levers,
    driven,
    largest,
    share_followed,
    with_motion,
)
from ecu.estimators.stability.permitted import BETTER, NONE, TRANSIENT
from ecu.estimators.stability.prediction import predict, with_levers
from ecu.estimators.stability.rollover import LoadedMachine, posed, share_lost
from ecu.estimators.stability.steady import SteadyTurns, least_margin, steady_turns
from ecu.estimators.stability.step import PredictionState

AMPLE = 0.25
"""Margin above the floor that a motion's estimated cost has to leave, so that it is permitted in full without a prediction.
The estimate of the cost may be 0.20 too small."""
SWING = 2.0
"""A step of force on an undamped spring: twice its size."""
DRIVEN_STEP = 0.05
"""The pose after a motion is found in steps of this length [s], half of the drive's lag."""
SOON = 0.12
"""A lever may also be let go so soon [s]: before its limit is looked for again and its drive has followed."""
RECOVERY_RATES = 4
"""Rates tried for recovery: the largest, a half, a quarter and an eighth of it."""
STOP_RATES = 4
"""Rates tried for a gentle stop: quarters of the present one."""
LEVER_TRIALS = 3
"""Halvings between no motion and the full one: the limit is known to an eighth of it."""


@compiled
def at_rate(levers: Levers, motion: int, rate: float, change: float) -> tuple[Turning, Turning]:
    """Lift arm and bucket where they are, one of them in this motion; rate [rad/s] and change [rad/s2] along it."""
    sign = 1.0 if motion in (LIFT_UP, TILT_BACK) else -1.0
    turning = Turning(levers.lift_angle, sign * rate, sign * change, 0.0)
    if motion in (LIFT_UP, LIFT_DOWN):
        return turning, Turning(levers.tilt_angle, 0.0, 0.0, 0.0)
    return Turning(levers.lift_angle, 0.0, 0.0, 0.0), Turning(
        levers.tilt_angle, sign * rate, sign * change, 0.0
    )


@compiled
def exerted(start: PredictionState, motion: int, rate: float, change: float, m: LoadedMachine) -> ArmForces:
    """Forces of the parts in this motion in the present turn."""
    lift, tilt = at_rate(start.levers, motion, rate, change)
    pose = pose_at(lift.angle, tilt.angle, m.arm, m.bucket)
    return arm_forces(pose, lift, tilt, start.yaw_rate + start.articulation_rate, m.payload, m.arm, m.bucket)


@compiled
def largest_loss(start: PredictionState, motion: int, machine: LoadedMachine) -> float:
    """What the full motion may cost of the margin: an even motion on springs, its start and its end.

    A push that fades with the drive's lag T swings a mode of frequency w by wT / sqrt(1 + (wT)^2) of its size, to both
    sides; start and end may come half a period apart.
    """
    rate, angle = largest(motion, machine.drive), start.articulation_angle
    change = rate / machine.drive.lag
    quick = machine.pitch_frequency * machine.drive.lag
    swing = quick / math.sqrt(1.0 + quick * quick)
    even = share_lost(exerted(start, motion, rate, 0.0, machine), angle, machine)
    begun = share_lost(exerted(start, motion, 0.0, change, machine), angle, machine)
    ended = share_lost(exerted(start, motion, 0.0, -change, machine), angle, machine)
    return SWING * even + swing * (begun + ended)


@compiled
def margin_after(floor: float, start: PredictionState, levers: Levers, m: LoadedMachine) -> float:
    """Least margin of the present turn in the pose that these demands lead to while a limit holds; floor: as of `least_margin`."""
    # the margins stay shares of what the wheels carry now
    return least_margin(floor, start.speed, turns_after(start, levers, m), start.ground, m)


@compiled
def turns_after(start: PredictionState, levers: Levers, m: LoadedMachine) -> SteadyTurns:
    """Steady turns at the present angle in the pose that these demands lead to while a limit holds."""
    lift = Turning(levers.lift_angle, levers.lift_rate, 0.0, 0.0)
    tilt = Turning(levers.tilt_angle, levers.tilt_rate, 0.0, 0.0)
    share = share_followed(DRIVEN_STEP, m.drive)
    for _ in range(int(m.prediction.limit_hold / DRIVEN_STEP + 0.5)):
        lift, tilt = driven(lift, tilt, levers, True, DRIVEN_STEP, share, m.drive)
    then = posed(m, lift.angle, tilt.angle)
    return steady_turns(start.articulation_angle, start.ground.z, then)


@compiled
def keeps_with_lever(start: PredictionState, motion: int, rate: float, m: LoadedMachine) -> bool:
    """Whether the motion at this rate [rad/s] keeps `margin_floor` over the horizon, and `turn_floor` in the pose it leads to.

    The driver may let the lever go at any time. Axles that swing bear that at one moment and not at another, so that an early end is
    judged beside the late one.
    """
    rules, levers = m.prediction, with_motion(start.levers, motion, rate)
    # the pose first: it costs a fifth of a prediction, and where it fails it spares one
    if margin_after(rules.turn_floor, start, levers, m) < rules.turn_floor:
        return False
    moving = with_levers(start, levers)
    if predict(moving, rules.limit_hold, rules.margin_floor, m).margin <= rules.margin_floor:
        return False
    return predict(moving, SOON, rules.margin_floor, m).margin > rules.margin_floor


@compiled
def recovery_lever(
    start: PredictionState, motion: int, rested: float, after_rest: float, m: LoadedMachine
) -> float:
    """Largest of the tried rates [rad/s] of this motion that bring the machine further from roll-over; 0 if none does.

    rested, after_rest: margins if the arm rests, over the horizon and in its pose. The pose that the rate leads to has to be better. On
    the way it may cost TRANSIENT of what the resting arm's pose gives, and not of the next moments: of a machine that swings each
    cycle would give up as much again.
    """
    high, least = (
        largest(motion, m.drive),
        max(rested, min(after_rest, m.prediction.margin_floor)) - TRANSIENT,
    )
    for k in range(RECOVERY_RATES):
        levers = with_motion(start.levers, motion, high / 2.0**k)
        if margin_after(NONE, start, levers, m) > after_rest + BETTER:
            moving = predict(with_levers(start, levers), m.prediction.limit_hold, least, m)
            if moving.margin > least:
                return high / 2.0**k
    return 0.0


@compiled
def present_rate(levers: Levers, motion: int) -> float:
    """How fast the part moves in this motion [rad/s]; 0 where it moves the other way."""
    rate = levers.lift_rate if motion in (LIFT_UP, LIFT_DOWN) else levers.tilt_rate
    return max(rate if motion in (LIFT_UP, TILT_BACK) else -rate, 0.0)


@compiled
def gentlest_stop(start: PredictionState, motion: int, rested: float, m: LoadedMachine) -> float:
    """The rate [rad/s], up to the present one, from which this motion ends with the largest margin; rested: if it ends at once.

    A part that stops at once pushes with all its momentum. Stopped in two steps it pushes twice, with half of it.
    """
    best, found, now = rested, 0.0, present_rate(start.levers, motion)
    for k in range(STOP_RATES):
        rate = now * (k + 1.0) / STOP_RATES
        moving = with_levers(start, with_motion(start.levers, motion, rate))
        left = predict(moving, m.prediction.limit_hold, best, m).margin
        if left > best + BETTER:
            best, found = left, rate
    return found


@compiled
def helping_lever(
    start: PredictionState, motion: int, rested: float, after_rest: float, m: LoadedMachine
) -> float:
    """The rate [rad/s] of this motion that helps where even the arm's rest violates a floor; arguments as of `recovery_lever`."""
    helps = recovery_lever(start, motion, rested, after_rest, m)
    return max(helps, gentlest_stop(start, motion, rested, m))


@compiled
def permitted_lever(start: PredictionState, motion: int, margin: float, m: LoadedMachine) -> float:
    """Largest rate [rad/s] of this motion that keeps the margins; the full one, without a prediction, where its cost leaves AMPLE.

    margin: the smallest predicted one without this motion. Where even the arm's rest violates a floor only a rate that
    helps is permitted.
    """
    high = largest(motion, m.drive)
    if leaves_ample(start, motion, margin, m) or keeps_with_lever(start, motion, high, m):
        return high
    return searched_lever(start, motion, m)


@compiled
def leaves_ample(start: PredictionState, motion: int, margin: float, m: LoadedMachine) -> bool:
    """Whether the full motion's estimated cost leaves AMPLE of the margin that is predicted without it."""
    rules = m.prediction
    left = margin - largest_loss(start, motion, m) - rules.margin_floor
    return min(left, margin - rules.turn_floor) > AMPLE


@compiled
def searched_lever(start: PredictionState, motion: int, m: LoadedMachine) -> float:
    """`permitted_lever` where the full rate does not keep the margins."""
    rules, low, high = m.prediction, 0.0, largest(motion, m.drive)
    rest = with_motion(start.levers, motion, 0.0)
    after_rest = margin_after(NONE, start, rest, m)
    rested = predict(with_levers(start, rest), rules.limit_hold, NONE, m).margin
    if after_rest < rules.turn_floor or rested <= rules.margin_floor:
        return helping_lever(start, motion, rested, after_rest, m)
    for _ in range(LEVER_TRIALS):
        trial = (low + high) / 2.0
        if keeps_with_lever(start, motion, trial, m):
            low = trial
        else:
            high = trial
    return low
