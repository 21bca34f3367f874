"""What the machine hears from the ECU: limits to obey, and the echo that shows how fast it answered.

A frame that fails its end-to-end check is a finding and is not used. Frames lost before a good one are a
finding, and the good one is used.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from bus.frame import Frame
from dbc.binding import Binding
from dbc.database import Database
from dbc.protection import Checker
from dbc.protection import Finding as Check
from plant.actuators import four
from plant.latency import ReactionStamps
from plant.limits import Limits

_LIMITS: Final = {
    "FrontLeftTorque": "N.m",
    "FrontRightTorque": "N.m",
    "RearLeftTorque": "N.m",
    "RearRightTorque": "N.m",
    "Speed": "m/s",
    "ArticulationRate": "rad/s",
}
_STATUS: Final = {"EchoSequence": "1"}
_QUIET: Final = (Check.OK, Check.INITIAL)


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong with a frame from the ECU."""

    message: str
    what: Check
    at_ns: int


class Reception:
    """The frames of the ECU that the machine uses; others are not looked at."""

    def __init__(self, database: Database) -> None:
        self.limits: Limits | None = None  # the last good ones
        self.limits_ns = 0  # when they came
        self.reactions = ReactionStamps()
        self._listeners = {
            message.codec.can_id: message
            for message in (
                _Listener(database, "Limits", _LIMITS, self._take_limits),
                _Listener(database, "EcuStatus", _STATUS, self._take_status),
            )
        }

    def receive(self, frame: Frame, now_ns: int) -> list[Finding]:
        """Use one frame, if it is one the machine uses and it is sound."""
        listener = self._listeners.get(frame.can_id)
        return listener.receive(frame, now_ns) if listener else []

    def _take_limits(self, values: tuple[float, ...], now_ns: int) -> None:
        self.limits = Limits(wheel_torque=four(values[:4]), speed=values[4], articulation_rate=values[5])
        self.limits_ns = now_ns
        self.reactions.limits(now_ns)

    def _take_status(self, values: tuple[float, ...], now_ns: int) -> None:
        self.reactions.status(int(values[0]), now_ns)


class _Listener:
    """One protected message: its check, its binding, and who takes its values."""

    def __init__(
        self,
        database: Database,
        name: str,
        signals: dict[str, str],
        take: Callable[[tuple[float, ...], int], None],
    ) -> None:
        self.codec = database.by_name[name]
        self._binding = Binding(self.codec, signals)
        self._checker = Checker(self.codec)
        self._take = take

    def receive(self, frame: Frame, now_ns: int) -> list[Finding]:
        check = self._checker.check(frame.data, now_ns)
        if check.usable:
            self._take(self._binding.decode(frame.data), now_ns)
        return [] if check in _QUIET else [Finding(self.codec.name, check, now_ns)]
