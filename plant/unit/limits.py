"""How the machine obeys the ECU's limits.

Drive torque is clamped wheel by wheel, articulation rate as a whole, the rates of lift arm and bucket by direction. Towards the speed limit the drive torque
fades out; above it the motors retard, and further above the service brake helps. When the Limits
or LinkageLimits frames stop, the machine falls back on safe values of its own: slow, weak and with gentle steering, so that
an ECU that dies cannot leave the machine unlimited.
"""

import math
from typing import NamedTuple

from configuration import CheckedTable
from plant.compiled import ruled
from plant.unit.actuators import Abilities, Four, Request
from plant.unit.script import DEGREE, KMH


class LinkageLimits(NamedTuple):
    """Largest rates of lift arm and bucket, each as a positive number [rad/s]."""

    lift_up: float = math.inf
    lift_down: float = math.inf
    tilt_back: float = math.inf
    tilt_forward: float = math.inf


FREE = LinkageLimits()


class Limits(NamedTuple):
    """Largest magnitudes, SI."""

    wheel_torque: Four  # drive torque per wheel [N m]
    speed: float  # over ground, forward or reverse [m/s]
    articulation_rate: float  # [rad/s]
    linkage: LinkageLimits = FREE


UNLIMITED = Limits(wheel_torque=(math.inf,) * 4, speed=math.inf, articulation_rate=math.inf)


class Obedience(NamedTuple):
    """The machine's own rules."""

    safe: Limits  # in force while the Limits frame is stale
    stale_after: float  # age of the last good Limits frame, or of the start, beyond which it is stale [s]
    fade: float  # width below the speed limit over which drive torque fades out [m/s]
    retard: float  # width above it over which the motors come to full retardation [m/s]
    brake: float  # width above that over which the brake comes to `brake_share` [m/s]
    # full retardation and braking against overspeed, as shares of the peak motor torque and of the full brake
    retard_share: float
    brake_share: float


@ruled
def in_force(last: Limits, age: float, linkage_age: float, obedience: Obedience) -> Limits:
    """The limits that hold: the last ones received, or the safe values when they are older than allowed.

    last: before the first frame UNLIMITED, with the age of the start, for a start is not a fault: an ECU has `stale_after` to come
    up. An ECU that never sends limits of the linkage does not limit it: they are then FREE, and of age 0.
    A value that the frame marks as not available (NaN) is replaced by its safe value.
    """
    safe, (torque, speed, rate, linkage) = obedience.safe, last
    linkage = safe.linkage if linkage_age > obedience.stale_after else _each_rate_or(linkage, safe.linkage)
    if age > obedience.stale_after:
        return Limits(safe.wheel_torque, safe.speed, safe.articulation_rate, linkage)
    return Limits(
        _each_or(torque, safe.wheel_torque),
        _or(speed, safe.speed),
        _or(rate, safe.articulation_rate),
        linkage,
    )


@ruled
def _each_rate_or(last: LinkageLimits, safe: LinkageLimits) -> LinkageLimits:
    return LinkageLimits(
        _or(last.lift_up, safe.lift_up),
        _or(last.lift_down, safe.lift_down),
        _or(last.tilt_back, safe.tilt_back),
        _or(last.tilt_forward, safe.tilt_forward),
    )


@ruled
def obey(
    request: Request, limits: Limits, obedience: Obedience, abilities: Abilities, speed: float
) -> Request:
    """The request as far as the limits permit.

    speed: as the machine measures it [m/s].
    """
    wheel, largest_speed, rate, (up, down, back, forward) = limits
    torque, brake, articulation, lift, tilt = _govern(request, largest_speed, obedience, abilities, speed)
    return Request(
        _each_within(torque, wheel),
        brake,
        min(max(articulation, -rate), rate),
        min(max(lift, -down), up),
        min(max(tilt, -forward), back),
    )


@ruled
def holds_back(demanded: Request, done: Request) -> bool:
    """Whether limits reduce the demanded drive torque of a wheel, or brake against it."""
    (a, b, c, d), (i, j, k, m) = demanded.wheel_torque, done.wheel_torque
    if abs(i) < abs(a) or abs(j) < abs(b) or abs(k) < abs(c) or abs(m) < abs(d):
        return True
    (a, b, c, d), (i, j, k, m) = demanded.brake_torque, done.brake_torque
    return i > a or j > b or k > c or m > d


@ruled
def _govern(
    request: Request, limit: float, obedience: Obedience, abilities: Abilities, speed: float
) -> Request:
    """Keep |speed| below `limit`: fade the torque that drives on, then retard, then brake."""
    over = abs(speed) - limit
    if over <= -obedience.fade:
        return request
    direction = math.copysign(1.0, speed)
    # three ramps in a row, each continuous, so that the governor does not hunt about the limit
    driving = min(max(-over / obedience.fade, 0.0), 1.0)
    retarding = obedience.retard_share * min(max(over / obedience.retard, 0.0), 1.0)
    braking = obedience.brake_share * min(max((over - obedience.retard) / obedience.brake, 0.0), 1.0)
    (a, b, c, d), (i, j, k, m) = request.wheel_torque, abilities.drive_torque
    torque = (
        _permitted(a, direction, driving, retarding * i),
        _permitted(b, direction, driving, retarding * j),
        _permitted(c, direction, driving, retarding * k),
        _permitted(d, direction, driving, retarding * m),
    )
    (a, b, c, d), (i, j, k, m) = request.brake_torque, abilities.brake_torque
    brake = max(a, braking * i), max(b, braking * j), max(c, braking * k), max(d, braking * m)
    return Request(torque, brake, request.articulation_rate, request.lift_rate, request.tilt_rate)


@ruled
def _permitted(torque: float, direction: float, driving: float, retarding: float) -> float:
    """Of one wheel; retarding: the torque that the governor takes for it."""
    forward = torque * direction
    # only torque that drives on is faded; a driver who retards harder than the governor keeps his torque
    return direction * min(forward * driving if forward > 0 else forward, -retarding)


@ruled
def _each_within(value: Four, bound: Four) -> Four:
    (a, b, c, d), (i, j, k, m) = value, bound
    return min(max(a, -i), i), min(max(b, -j), j), min(max(c, -k), k), min(max(d, -m), m)


@ruled
def _each_or(value: Four, safe: Four) -> Four:
    (a, b, c, d), (i, j, k, m) = value, safe
    return _or(a, i), _or(b, j), _or(c, k), _or(d, m)


@ruled
def _or(value: float, safe: float) -> float:
    return safe if math.isnan(value) else value


def read_obedience(table: CheckedTable) -> Obedience:
    """The [limits] table of an equipment file."""
    safe = table.table("safe_values")
    torque = safe.number("wheel_torque_kn_m", unit="kN m", low=0.0, high=50.0) * 1e3
    lift, tilt = (
        safe.number(f"{what}_rate_deg_s", unit="deg/s", low=0.0, high=90.0, default=90.0) * DEGREE
        for what in ("lift", "tilt")
    )
    limits = Limits(
        linkage=LinkageLimits(lift_up=lift, lift_down=lift, tilt_back=tilt, tilt_forward=tilt),
        wheel_torque=(torque,) * 4,
        speed=safe.number("speed_kmh", unit="km/h", low=0.0, high=50.0) * KMH,
        articulation_rate=safe.number("articulation_rate_deg_s", unit="deg/s", low=0.0, high=50.0) * DEGREE,
    )
    safe.finish()
    obedience = Obedience(
        safe=limits,
        stale_after=table.number("stale_after_ms", unit="ms", low=10.0, high=1000.0) / 1e3,
        fade=table.number("fade_kmh", unit="km/h", low=0.1, high=10.0) * KMH,
        retard=table.number("retard_kmh", unit="km/h", low=0.1, high=20.0) * KMH,
        brake=table.number("brake_kmh", unit="km/h", low=0.1, high=20.0) * KMH,
        retard_share=table.number("retard_percent", unit="%", low=0.0, high=100.0) / 100,
        brake_share=table.number("brake_percent", unit="%", low=0.0, high=100.0) / 100,
    )
    table.finish()
    return obedience
