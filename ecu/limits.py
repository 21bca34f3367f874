"""Limits on wheel torque, speed, articulation rate and the rates of lift arm and bucket that keep the machine on its wheels.

The estimators say which rates and which speed leave a margin over the prediction horizon;
here they become limits that fall at once (or as fast as the machine can brake) and rise slowly, so that
the driver feels one intervention and not a flutter. Where the roll-over margin is not valid, safe values hold.
"""

import enum
import math
from dataclasses import dataclass

from ecu.alarms import SILENT, Alarm, Times, after, below
from ecu.estimators.parameters import LinkageDrive, PredictionRules
from ecu.estimators.signals import Estimates
from ecu.estimators.stability.levers import LIFT_DOWN, LIFT_UP, MOTIONS, TILT_BACK
from ecu.rules import LimitRules

SPEED_HEADROOM = 0.3
"""A falling speed limit starts this far above the present speed [m/s]: a higher start would not limit anything."""


Levers = tuple[float, float, float, float]
"""Rates of lift arm up and down, bucket back and forward [rad/s]; infinity does not limit."""
NO_LEVER_LIMITS: Levers = (math.inf,) * 4


class Cause(enum.IntEnum):
    """Values are those of Limits.Cause and LinkageLimits.Cause in the DBC."""

    NO_LIMIT = 0
    PRECAUTION = 1
    ROLL_OVER_PREVENTION = 2
    SAFE_VALUES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The limits that the machine obeys."""

    front_torque: float  # of each front wheel [N m]
    rear_torque: float
    speed: float  # [m/s]
    rate: float  # of articulation, to either side [rad/s]
    cause: Cause
    direction: float = 0.0  # side that the rate was found for: +1 left, -1 right, 0 both
    levers: Levers = NO_LEVER_LIMITS
    lever_cause: Cause = Cause.NO_LIMIT
    prevention: Alarm = SILENT  # whether prevention acts; carried to the next cycle


def unlimited(rules: LimitRules, prediction: PredictionRules) -> Limits:
    """The machine's own limits only."""
    return Limits(
        front_torque=rules.front_torque,
        rear_torque=rules.rear_torque,
        speed=prediction.largest_speed,
        rate=prediction.largest_rate,
        cause=Cause.NO_LIMIT,
    )


def safe(rules: LimitRules) -> Limits:
    """Limits while the roll-over margin is not known."""
    return Limits(
        front_torque=min(rules.safe_torque, rules.front_torque),
        rear_torque=min(rules.safe_torque, rules.rear_torque),
        speed=rules.safe_speed,
        rate=rules.safe_rate,
        levers=(rules.safe_lift_rate, rules.safe_lift_rate, rules.safe_tilt_rate, rules.safe_tilt_rate),
        lever_cause=Cause.SAFE_VALUES,
        cause=Cause.SAFE_VALUES,
    )


def torque_share(margin: float, rules: LimitRules) -> float:
    """Share of the full torque at a predicted margin: linear between the two thresholds."""
    span = rules.torque_full_margin - rules.torque_least_margin
    place = min(max((margin - rules.torque_least_margin) / span, 0.0), 1.0)
    return rules.torque_least_share + (1.0 - rules.torque_least_share) * place


def next_lever(before: float, permitted: float, full: float, rise: float) -> float:
    """The limit of one motion [rad/s]: it rises no faster than it may; where it comes to what the drive can do, it is none."""
    reached = min(permitted, before + rise)
    return math.inf if reached >= full else reached


def next_levers(
    before: Levers, estimates: Estimates, dt: float, rules: LimitRules, drive: LinkageDrive
) -> Levers:
    """The limits of the levers' motions; the estimates bring one of them, the others stay as they are."""
    motion, permitted = int(estimates.permitted_motion), estimates.permitted_lever
    rise = rules.linkage_rise * dt * MOTIONS  # once in so many cycles
    up, down, back, forward = before
    if motion == LIFT_UP:
        up = next_lever(up, permitted, drive.lift_up, rise)
    elif motion == LIFT_DOWN:
        down = next_lever(down, permitted, drive.lift_down, rise)
    elif motion == TILT_BACK:
        back = next_lever(back, permitted, drive.tilt_back, rise)
    else:
        forward = next_lever(forward, permitted, drive.tilt_forward, rise)
    return up, down, back, forward


def next_limits(
    before: Limits,
    estimates: Estimates,
    now_ns: int,
    dt: float,
    times: Times,
    rules: LimitRules,
    none: Limits,
    drive: LinkageDrive,
) -> Limits:
    """The limits of this cycle from a valid prediction. times: those of the prevention; dt [s]; none: the machine's own limits."""
    margin = min(estimates.predicted_margin, estimates.lift_off_margin)
    hysteresis = rules.release_margin - rules.engage_margin
    close = below(margin, rules.engage_margin, hysteresis, before.prevention.on)
    prevention = after(before.prevention, close, now_ns, times)
    rate = min(estimates.permitted_rate, none.rate)
    side = estimates.permitted_direction
    if side * before.direction >= 0.0:  # a driver who turns back is not held by the limit of the other side
        rate = min(rate, before.rate + rules.rate_rise * dt)
    permitted = max(estimates.permitted_speed, rules.creep_speed)
    start = min(before.speed, max(abs(estimates.speed) + SPEED_HEADROOM, permitted))
    speed = max(permitted, start - rules.speed_fall * dt)
    speed = min(speed, before.speed + rules.speed_rise * dt, none.speed)
    share = torque_share(margin, rules)
    front = min(share * none.front_torque, before.front_torque + rules.torque_rise * dt)
    rear = min(share * none.rear_torque, before.rear_torque + rules.torque_rise * dt)
    levers = next_levers(before.levers, estimates, dt, rules, drive)
    lever_cause = Cause.NO_LIMIT
    up, down, back, forward = levers
    if min(up, down, back, forward) < math.inf:
        lever_cause = Cause.ROLL_OVER_PREVENTION if prevention.on else Cause.PRECAUTION
    limited = rate < none.rate or speed < none.speed or front < none.front_torque or rear < none.rear_torque
    cause = Cause.PRECAUTION if limited else Cause.NO_LIMIT
    return Limits(
        front_torque=front,
        rear_torque=rear,
        speed=speed,
        rate=rate,
        levers=levers,
        lever_cause=lever_cause,
        direction=side if side != 0.0 else before.direction,
        cause=Cause.ROLL_OVER_PREVENTION if prevention.on else cause,
        prevention=prevention,
    )
