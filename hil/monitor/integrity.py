"""Whether protected frames are whole and follow one another, judged per bus and identifier."""

from bus.frame import Frame
from dbc.database import MessageCodec
from dbc.protection import Checker, Finding

_UNREMARKABLE = (Finding.OK, Finding.INITIAL)


class Integrity:
    """The checks of everything that is shown; each stream of frames has a state of its own."""

    def __init__(self) -> None:
        self._checkers: dict[tuple[str, int], Checker] = {}

    def findings(self, bus: str, frame: Frame, codec: MessageCodec) -> list[str]:
        """What is wrong with a frame, [] for nothing or a message without protection."""
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
