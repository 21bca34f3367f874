"""The machine's reception of the ECU's frames: limits to obey, and checks of the frames.

A frame that fails its end-to-end check is a finding and is not used. Frames lost before a good one are a
finding, and the good one is used.
"""

from dataclasses import dataclass
from typing import Final

from bus.frame import Frame
from dbc.binding import Binding
from dbc.database import Database
from dbc.protection import Checker
from dbc.protection import Finding as Check
from plant.unit.limits import UNLIMITED, Limits, LinkageLimits

_LIMITS: Final = {
    "FrontLeftTorque": "N.m",
    "FrontRightTorque": "N.m",
    "RearLeftTorque": "N.m",
    "RearRightTorque": "N.m",
    "Speed": "m/s",
    "ArticulationRate": "rad/s",
}
_LINKAGE: Final = dict.fromkeys(("LiftUpRate", "LiftDownRate", "TiltBackRate", "TiltForwardRate"), "rad/s")
_QUIET: Final = (Check.OK, Check.INITIAL)  # the first frame has no counter before it to compare with


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong with a frame from the ECU."""

    message: str  # its name in the DBC
    what: Check
    at_ns: int  # when it was received, on the machine's clock


class Reception:
    """The frames of the ECU that the machine looks at; it obeys the limits, of the status it only checks whether it is sound."""

    def __init__(self, database: Database) -> None:
        self.limits = UNLIMITED  # the last good ones; those of the linkage come in a frame of their own
        self.limits_ns = 0  # when they came
        self.linkage_ns: int | None = None  # when those of the linkage came
        limits, linkage = database.by_name["Limits"], database.by_name["LinkageLimits"]
        self._binding, self._linkage_binding = Binding(limits, _LIMITS), Binding(linkage, _LINKAGE)
        self._limits_id, self._linkage_id = limits.can_id, linkage.can_id
        self._codecs = {codec.can_id: codec for codec in (limits, linkage, database.by_name["EcuStatus"])}
        self._checkers = {can_id: Checker(codec) for can_id, codec in self._codecs.items()}

    @property
    def wanted(self) -> frozenset[int]:
        """Identifiers of the frames that the machine uses."""
        return frozenset(self._codecs)

    def receive(self, frame: Frame, now_ns: int) -> list[Finding]:
        """Use one frame, if it is one the machine uses and it is sound."""
        checker = self._checkers.get(frame.can_id)
        if checker is None:
            return []
        check = checker.check(frame.data, now_ns)
        if check.usable and frame.can_id == self._limits_id:
            a, b, c, d, speed, rate = self._binding.decode(frame.data)
            self.limits = Limits((a, b, c, d), speed, rate, self.limits.linkage)
            self.limits_ns = now_ns
        elif check.usable and frame.can_id == self._linkage_id:
            up, down, back, forward = self._linkage_binding.decode(frame.data)
            torque, speed, rate, _ = self.limits
            self.limits = Limits(torque, speed, rate, LinkageLimits(up, down, back, forward))
            self.linkage_ns = now_ns
        return [] if check in _QUIET else [Finding(self._codecs[frame.can_id].name, check, now_ns)]
