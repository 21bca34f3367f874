"""Checks CRC and counter of protected frames for the monitor, per bus and identifier."""

from bus.frame import Frame
from dbc.database import MessageCodec
from dbc.protection import Checker, Finding

_UNREMARKABLE = (Finding.OK, Finding.INITIAL)


class Integrity:
    """The checks of all shown frames; each bus and identifier has a counter of its own."""

    def __init__(self) -> None:
        self._checkers: dict[tuple[str, int], Checker] = {}

    def findings(self, bus: str, frame: Frame, codec: MessageCodec) -> list[str]:
        """The findings on a frame; [] for an intact one or a message without protection."""
        if codec.protection is None:
            return []
        key = bus, frame.can_id
        checker = self._checkers.get(key)
        if checker is None:
            checker = self._checkers[key] = Checker(codec)
        finding = checker.check(frame.data, frame.at_ns)
        if finding in _UNREMARKABLE:
            return []
        if finding is Finding.LOST:
            return [f"{checker.lost} frames lost before this one"]
        if finding is Finding.MASQUERADED:
            return [f"{finding.value}: {checker.claimed}"]
        return [finding.value]
