"""Lift arm and bucket as a prediction drives them: how they follow the levers, and which way a lever moves them.

The four motions of the two levers are numbered as the limits on the bus are: lift arm up and down, bucket back and forward.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.motion.arm import STILL, Turning
from ecu.estimators.parameters import LinkageDrive

MOTIONS = 4
LIFT_UP, LIFT_DOWN, TILT_BACK, TILT_FORWARD = range(MOTIONS)


class Levers(NamedTuple):
    """Lift arm and bucket now, and the rates that are demanded of them; upwards and back positive."""

    lift_angle: float  # above the front frame's horizontal [rad]
    lift_rate: float  # [rad/s]
    lift_demand: float  # [rad/s]
    tilt_angle: float
    tilt_rate: float
    tilt_demand: float


@compiled
def moved(levers: Levers) -> bool:
    """Whether lift arm or bucket moves or is to move."""
    turning = max(abs(levers.lift_rate), abs(levers.tilt_rate)) > STILL
    return turning or levers.lift_demand != 0.0 or levers.tilt_demand != 0.0


@compiled
def demanded(lever: float, up: float, down: float, up_limit: float, down_limit: float) -> float:
    """Rate [rad/s] that a lever (share of its way) asks for and is permitted; up, down: at the full lever."""
    return min(lever * up, up_limit) if lever > 0.0 else max(lever * down, -down_limit)


@compiled
def share_followed(dt: float, drive: LinkageDrive) -> float:
    """Share of the way to its demand that a rate goes within `dt` [s]; the same in every step of a prediction."""
    return 1.0 - math.exp(-dt / drive.lag)


@inlined
def followed(
    part: Turning, demand: float, dt: float, share: float, low: float, high: float, cushion: float
) -> Turning:
    """The part `dt` [s] later: its rate goes a `share` of the way to the demand, and fades before the end of the stroke.

    cushion: time constant of that fading [s].
    """
    rate = part.rate + (demand - part.rate) * share
    left = high - part.angle if rate > 0.0 else part.angle - low
    most = max(left, 0.0) / cushion
    rate = min(max(rate, -most), most)
    return Turning(part.angle + rate * dt, rate, (rate - part.rate) / dt, part.sample)


@inlined
def driven(
    lift: Turning, tilt: Turning, levers: Levers, held: bool, dt: float, share: float, drive: LinkageDrive
) -> tuple[Turning, Turning]:
    """Lift arm and bucket `dt` [s] later; held: whether the levers are still held; share: of `share_followed`."""
    up, back = (levers.lift_demand, levers.tilt_demand) if held else (0.0, 0.0)
    return (
        followed(lift, up, dt, share, drive.lift_low, drive.lift_high, drive.cushion),
        followed(tilt, back, dt, share, drive.tilt_low, drive.tilt_high, drive.cushion),
    )


@compiled
def largest(motion: int, drive: LinkageDrive) -> float:
    """Rate at the full lever [rad/s]."""
    if motion == LIFT_UP:
        return drive.lift_up
    if motion == LIFT_DOWN:
        return drive.lift_down
    return drive.tilt_back if motion == TILT_BACK else drive.tilt_forward


@compiled
def with_motion(levers: Levers, motion: int, rate: float) -> Levers:
    """The same with one of the four motions demanded at this rate [rad/s, positive]."""
    lift, tilt = levers.lift_demand, levers.tilt_demand
    if motion == LIFT_UP:
        lift = rate
    elif motion == LIFT_DOWN:
        lift = -rate
    elif motion == TILT_BACK:
        tilt = rate
    else:
        tilt = -rate
    return Levers(levers.lift_angle, levers.lift_rate, lift, levers.tilt_angle, levers.tilt_rate, tilt)
