"""Which estimates contradict a law they have to obey, so that they must not be called valid.

An estimate can be wrong although every input it needs is usable: after a lift-off, with a wrong but plausible sensor,
or beyond the range of its signal. Rules: a tyre pushes and never pulls; the loads add up to mass times vertical specific force; the balance of
forces and the gyro agree about the tilt on the tyres; a load-transfer ratio lies within -1 and 1; a tyre gives no more than friction times its
load; a speed is proved by wheels that do not slide; a value outside the range of its signal would arrive changed. Loads that break a rule take with them all that comes from the same balance.
Warnings and limits do not ask for this: that a wheel has lifted is known also when its load is not.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from dbc.binding import Binding
from dbc.database import Database
from ecu.bus_signals import Sent, rows
from ecu.estimators.parameters import Wheel
from ecu.estimators.signals import Estimates
from ecu.estimators.tyres.contact import CONTRADICTION
from ecu.validity import NEEDS, WHEELS

PULL: Final = 0.05
"""Share of the tyre's nominal load by which an estimated load may be negative, or their sum be off: the noise of the sensors."""
SETTLING_NS: Final = 200_000_000
"""Time without a broken rule until an estimate is valid again."""
FRICTION: Final = 1.5
"""Times the friction of a dry road, plus PULL of the nominal load: beyond any tyre; 0.8 of it is reached in the drive cases."""
DOUBTFUL: Final = 0.3
"""Doubt of the speed [m/s] beyond which it is not valid: no wheel has proved it for 0.4 s. It is 1 km/h, as a speedometer's error."""
FROM_SPEED: Final = frozenset({"speed"} | {f"slip_{n}" for n in WHEELS})
"""What a wrong speed makes wrong: a slip is the difference of two speeds."""

FROM_LOADS: Final = frozenset(
    {"normal", "roll_over", "yaw_moment", "joint_torque", "payload"}
    | {f"{kind}_{n}" for kind in ("slip", "force") for n in WHEELS}
)
"""What the balance of a machine on its four wheels gives: of these nothing is valid where its loads are not. Payload and joint torque
need no load, but the motion that explains their pressures and forces is the same."""


class Range(NamedTuple):
    """Values that a signal can carry, SI."""

    validity: str  # entry of the validity table
    place: int  # of the estimate
    least: float
    most: float


class Consistency:
    """The rules for one machine."""

    def __init__(self, wheel: Wheel, database: Database) -> None:
        self.ranges = tuple(_ranges(database))
        self._broken_ns: dict[str, int] = {}  # when an entry last broke a rule
        self.change(wheel)

    def change(self, wheel: Wheel) -> None:
        """Judge by another wheel from now on."""
        self._pull = PULL * wheel.nominal_load
        self._friction = FRICTION * max(wheel.friction, wheel.lateral_peak)

    def contradicted(self, e: Estimates) -> frozenset[str]:
        """Entries of the validity table whose estimates break a rule."""
        normal, along = e[0:4], e[4:8]
        across = (e.lateral_1, e.lateral_2, e.lateral_3, e.lateral_4)
        found = {validity for validity, k, least, most in self.ranges if not least <= e[k] <= most}
        if min(normal) < -self._pull or abs(e.load_gap) > self._pull:
            found.add("normal")
        if e.load_contradiction > CONTRADICTION:
            found.add("normal")
        if max(abs(e.load_transfer_ratio), abs(e.predicted_load_transfer_ratio)) > 1.0:
            found.add("roll_over")
        for n, load, x, y in zip(WHEELS, normal, along, across, strict=True):
            if math.hypot(x, y) > self._friction * max(load, 0.0) + self._pull:
                found.add(f"force_{n}")
        if e.speed_doubt > DOUBTFUL:
            found |= FROM_SPEED
        return frozenset(found | FROM_LOADS) if "normal" in found else frozenset(found)

    def valid(self, e: Estimates, known: Mapping[str, bool], now_ns: int) -> Mapping[str, bool]:
        """What may be called valid: the inputs are usable (`known`), and no rule has been broken for SETTLING_NS.

        After a broken rule every wheel has to bear load before loads count as right again.
        """
        broken = self.contradicted(e)
        if min(e[0:4]) < self._pull and now_ns - self._broken_ns.get("normal", -SETTLING_NS) < SETTLING_NS:
            # The estimated load of a lifted wheel swings about zero. It has landed only when it bears load again.
            broken |= FROM_LOADS
        for name in broken:
            self._broken_ns[name] = now_ns
        if not self._broken_ns:
            return known
        self._broken_ns = {name: at for name, at in self._broken_ns.items() if now_ns - at < SETTLING_NS}
        return {name: flag and name not in self._broken_ns for name, flag in known.items()}

    def forget(self) -> None:
        """As after power-on: no rule has been broken."""
        self._broken_ns.clear()


def _ranges(database: Database) -> list[Range]:
    """Ranges of the sent estimates that have a validity."""
    found = []
    for name, row in rows(Estimates, Sent):
        if row.validity:
            binding = Binding(database.by_name[row.message], {row.signal: row.unit})
            signal, factor = binding.codec.by_signal[row.signal], binding.factors[0]
            least = -math.inf if signal.minimum is None else signal.minimum * factor
            most = math.inf if signal.maximum is None else signal.maximum * factor
            found.append(Range(row.validity, Estimates._fields.index(name), least, most))
    assert {r.validity for r in found} <= set(NEEDS)
    return found
