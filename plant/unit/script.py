"""The script of a scenario: the driver's intentions over time.

Speed or torque, angle or rate: the driver either holds a speed or sets the pedal, either steers to
an angle or holds the joystick.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from configuration import CheckedTable
from plant.unit.profile import Profile

KMH = 1 / 3.6
DEGREE = math.pi / 180


class Wish(NamedTuple):
    """The driver's intention at one time. SI; shares of full demand are -1..1. None: this quantity is not controlled."""

    speed: float | None = None
    torque: float | None = None
    brake: float = 0.0  # 0..1
    articulation_angle: float | None = None
    articulation_angle_rate: float = 0.0  # slope of the wanted angle
    articulation_rate: float | None = None
    lift: float = 0.0
    tilt: float = 0.0


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

    def at(self, time: float, *, step: float) -> Wish:
        """The wishes at `time` [s]; slopes are taken over the next `step` [s]."""
        angle = self.articulation_angle
        wanted = angle.at(time) if angle else None
        slope = (angle.at(time + step) - wanted) / step if angle and wanted is not None else 0.0
        return Wish(
            self.speed.at(time) if self.speed else None,
            self.torque.at(time) if self.torque else None,
            self.brake.at(time) if self.brake else 0.0,
            wanted,
            slope,
            self.articulation_rate.at(time) if self.articulation_rate else None,
            self.lift.at(time) if self.lift else 0.0,
            self.tilt.at(time) if self.tilt else 0.0,
        )


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
