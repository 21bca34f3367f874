"""The script of a scenario: the driver's intentions over time.

Speed or torque, angle or rate: the driver either holds a speed or sets the pedal, either steers to
an angle or holds the joystick.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from configuration import CheckedTable
from plant.compiled import ruled
from plant.unit.profile import Curves, Profile, curves_of, value_at

KMH = 1 / 3.6
DEGREE = math.pi / 180


class Wish(NamedTuple):
    """The driver's intention at one time. SI; shares of full demand are -1..1."""

    speed: float = math.nan  # NaN: not held, the pedal is at `torque`
    torque: float = 0.0
    brake: float = 0.0  # 0..1
    articulation_angle: float = math.nan  # NaN: not steered to, the joystick is at `articulation_rate`
    articulation_angle_rate: float = 0.0  # slope of the wanted angle
    articulation_rate: float = 0.0
    lift: float = 0.0
    tilt: float = 0.0


SPEED, TORQUE, BRAKE, ANGLE, RATE, LIFT, TILT = range(7)
"""Profiles of a script, in the order of `Script.curves`."""


@ruled
def wish_at(curves: Curves, time: float, step: float) -> Wish:
    """The wishes of a script at `time` [s]; slopes are taken over the next `step` [s]."""
    starts = curves.starts
    speed = value_at(curves, SPEED, time) if starts[SPEED] < starts[SPEED + 1] else math.nan
    angle, slope = math.nan, 0.0
    if starts[ANGLE] < starts[ANGLE + 1]:
        angle = value_at(curves, ANGLE, time)
        slope = (value_at(curves, ANGLE, time + step) - angle) / step
    return Wish(
        speed,
        value_at(curves, TORQUE, time),
        value_at(curves, BRAKE, time),
        angle,
        slope,
        value_at(curves, RATE, time),
        value_at(curves, LIFT, time),
        value_at(curves, TILT, time),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Script:
    """Profiles of the wishes; those that are None are not driven."""

    speed: Profile | None = None
    torque: Profile | None = None
    brake: Profile | None = None
    articulation_angle: Profile | None = None
    articulation_rate: Profile | None = None
    lift: Profile | None = None
    tilt: Profile | None = None

    def curves(self) -> Curves:
        """The same profiles as numbers."""
        driven = (self.speed, self.torque, self.brake, self.articulation_angle, self.articulation_rate)
        return curves_of((*driven, self.lift, self.tilt))


def read_script(table: CheckedTable) -> Script:
    """The [driver] table of a scenario."""

    def profile(key: str, unit: str, si: float, low: float, high: float) -> Profile | None:
        return Profile.read(table.table(key), unit=unit, si=si, low=low, high=high) if key in table else None

    script = Script(
        speed=profile("speed_kmh", "km/h", KMH, -20.0, 40.0),
        torque=profile("torque_percent", "%", 0.01, -100.0, 100.0),
        brake=profile("brake_percent", "%", 0.01, 0.0, 100.0),
        articulation_angle=profile("articulation_deg", "deg", DEGREE, -40.0, 40.0),
        articulation_rate=profile("articulation_rate_deg_s", "deg/s", DEGREE, -80.0, 80.0),
        lift=profile("lift_percent", "%", 0.01, -100.0, 100.0),
        tilt=profile("tilt_percent", "%", 0.01, -100.0, 100.0),
    )
    for one, other in (("speed_kmh", "torque_percent"), ("articulation_deg", "articulation_rate_deg_s")):
        if one in table and other in table:
            raise table.error(other, f"and {one} cannot both be given: the driver does one or the other")
    table.finish()
    return script
