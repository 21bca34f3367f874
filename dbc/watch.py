"""Supervises one received message over time, for ECU, gateway and bench: troubles of its frames, validity of its values.

`Checker` judges a frame; a watch adds what only time shows (late, silent) and the state machine of AUTOSAR's
end-to-end protocol (PRS_E2EProtocol, E2E state machine): a window of the last judgements decides whether the
message is valid. A frame that is intact and new counts as good, a broken or foreign one as bad; one that is
repeated, overtaken or missing counts as neither, but takes the place of a good one.

An unprotected message has no counter and no CRC: only its length and its times are judged.
"""

import enum
from collections import Counter, deque
from dataclasses import dataclass
from typing import Final

from dbc.database import MessageCodec
from dbc.protection import Checker, Finding

LATE: Final = 1.5
"""A frame is late when the gap before it exceeds this many cycle times: from there on the next one is nearer."""
SILENT: Final = 3.0
"""Cycle times without a frame after which a message is silent."""
WINDOW: Final = 10
"""Judgements remembered."""


class Trouble(enum.Enum):
    """What can be wrong with a message; distinguished wherever a frame allows it."""

    WRONG_CRC = "wrong CRC"
    WRONG_COUNTER = "counter 15 is never sent"
    WRONG_LENGTH = "wrong length"
    MASQUERADED = "CRC is that of another message"
    REPEATED = "counter repeated"
    REORDERED = "older than the previous frame"
    RESTARTED = "counter jumped and goes on from there"
    LOST = "frames lost before this one"
    LATE = "late"
    SILENT = "silent"


class State(enum.Enum):
    """Of AUTOSAR's state machine."""

    NO_DATA = "no data"
    INIT = "init"
    VALID = "valid"
    INVALID = "invalid"


@dataclass(frozen=True, slots=True)
class Rules:
    """Conditions of a state on the last WINDOW judgements."""

    least_good: int  # good judgements that it needs
    most_bad: int  # bad judgements that it tolerates


RULES: Final = {State.INIT: Rules(1, 0), State.VALID: Rules(7, 1), State.INVALID: Rules(9, 0)}
"""Where the state is now; it is VALID next if the rules of its row hold. INIT waits, the others are INVALID."""

_TROUBLES: Final = {
    Finding.WRONG_CRC: Trouble.WRONG_CRC,
    Finding.WRONG_COUNTER: Trouble.WRONG_COUNTER,
    Finding.WRONG_LENGTH: Trouble.WRONG_LENGTH,
    Finding.MASQUERADED: Trouble.MASQUERADED,
    Finding.REPEATED: Trouble.REPEATED,
    Finding.REORDERED: Trouble.REORDERED,
    Finding.RESTARTED: Trouble.RESTARTED,
    Finding.LOST: Trouble.LOST,
}
_BAD: Final = frozenset({Trouble.WRONG_CRC, Trouble.WRONG_COUNTER, Trouble.WRONG_LENGTH, Trouble.MASQUERADED})
_GOOD: Final = frozenset({None, Trouble.LOST, Trouble.RESTARTED, Trouble.LATE})


class Watch:
    """Watches one message. `counts` has how many frames each trouble struck; LOST counts the missing frames."""

    def __init__(self, codec: MessageCodec) -> None:
        self.codec = codec
        self.state = State.NO_DATA
        self.counts: Counter[Trouble] = Counter()
        self.frames = 0
        self.claimed = ""  # the message whose data id fits the last masqueraded frame
        self._checker = Checker(codec) if codec.protection is not None else None
        self._heard_ns: int | None = None
        self._silent = False
        self._window: deque[bool | None] = deque(maxlen=WINDOW)  # good, bad, or neither
        self._good = self._bad = 0

    def receive(self, data: bytes, now_ns: int) -> Trouble | None:
        """Judge a frame that came at `now_ns`; None if nothing is wrong with it."""
        self.frames += 1
        trouble = self._check(data, now_ns)
        if trouble is None and self._is_late(now_ns):
            trouble = Trouble.LATE
        self._heard_ns, self._silent = now_ns, False
        if trouble is not None:
            self.counts[trouble] += self._checker.lost if trouble is Trouble.LOST and self._checker else 1
        self._judge(True if trouble in _GOOD else False if trouble in _BAD else None)
        return trouble

    def _check(self, data: bytes, now_ns: int) -> Trouble | None:
        if self._checker is None:
            return Trouble.WRONG_LENGTH if len(data) != self.codec.length else None
        found = self._checker.check(data, now_ns)
        if found is Finding.MASQUERADED:
            self.claimed = self._checker.claimed
        return _TROUBLES.get(found)

    def _is_late(self, now_ns: int) -> bool:
        return self._heard_ns is not None and now_ns - self._heard_ns > LATE * self.codec.cycle_ns > 0

    def overdue(self, now_ns: int) -> Trouble | None:
        """SILENT once, when no frame has come for too long; None before the first frame, and without a cycle time."""
        cycle_ns = self.codec.cycle_ns
        if self._heard_ns is None or self._silent or cycle_ns == 0:
            return None
        if now_ns - self._heard_ns <= SILENT * cycle_ns:
            return None
        self._silent = True
        self.counts[Trouble.SILENT] += 1
        # as if a whole window of neither good nor bad had come: a silent message loses its validity
        for _ in range(WINDOW):
            self._judge(None)
        return Trouble.SILENT

    def _judge(self, good: bool | None) -> None:
        """Put one judgement into the window, and move."""
        window = self._window
        if len(window) == WINDOW:
            oldest = window[0]
            self._good -= oldest is True
            self._bad -= oldest is False
        window.append(good)
        self._good += good is True
        self._bad += good is False
        if self.state is State.NO_DATA:
            self.state = State.INIT
        rules = RULES[self.state]
        # until the window has filled once, one good frame is enough: a start must not take ten cycles
        enough = self._good >= (rules.least_good if len(window) == WINDOW else 1)
        if enough and self._bad <= rules.most_bad:
            self.state = State.VALID
        elif self.state is State.VALID or self._bad > rules.most_bad:
            self.state = State.INVALID
