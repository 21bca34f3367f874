"""Divides a recording into the ticks of the ECU, for `into_ecu`: frames received before each tick, its time, its answers.

Pure: a table in. The ECU's frames are recognised by their sender in the DBC; all others are frames that it received. The
schedule says which messages are due at a tick, so its answers are the next so many. The time of a tick is:

- on the virtual clock, the first answer's stamp (less a constant, which nothing depends on);
- in real time, whole periods: EcuStatus counts the skipped ones, and the grid is taken from the ticks that started
  promptly. A tick starts later than it is due; the frames that it had received are those before its last answer's
  stamp less the execution time, which the next EcuStatus reports. EcuStatus also echoes the newest sample received.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, REMOTE, Frame
from dbc.database import Database
from dbc.errors import LogError
from dbc.recordings.logfile import FrameTable

ECU = "EstimatorEcu"
STATUS, SAMPLES = "EcuStatus", "Articulation"
TICK_NS = 10_000_000
_AT_REST = 0  # EcuStatus.State: init
_PROMPT = 10  # percentile of the ticks by their lateness from which the grid is taken
_LOOKED_THROUGH = 40  # answers at the start of a recording that may be the rest of a tick
_ECHOED_WITHIN = 20  # samples back from the answer that the echo is looked for
_OPEN_ROWS = 20  # rows back that a tick without an echo may not have heard
_COUNTER_BYTE, _COUNTER_BITS = 1, 0x0F


@dataclass(frozen=True, slots=True)
class Tick:
    """One tick as recorded."""

    rows: Sequence[int]  # of its answers
    now_ns: int  # when it was due
    execution_ns: int  # from its status
    overruns: int  # from its status
    heard_before: int  # by the stamps, the row before which it had received every frame
    earliest: int  # bounds of `heard_before`
    latest: int


class Recorded:
    """The rows of a table divided into frames that the ECU received and its answers."""

    def __init__(self, table: FrameTable, database: Database) -> None:
        self.frames = list(table.frames())
        self.codecs = {codec.can_id: codec for codec in database.by_name.values() if ECU in codec.senders}
        samples = database.by_name[SAMPLES]
        self.answers = [row for row, frame in enumerate(self.frames) if frame.can_id in self.codecs]
        self.heard = [
            row for row, frame in enumerate(self.frames)
            if frame.can_id not in self.codecs and not frame.can_id & (ERROR | REMOTE)
        ]  # fmt: skip
        present = {self.frames[row].can_id for row in self.answers}
        # a recording may be older than a message that an ECU may leave out
        self.left_out = {i for i, codec in self.codecs.items() if codec.is_optional and i not in present}
        self.first_heard = self.heard[0] if self.heard else len(self.frames)
        self._sample_rows = [
            row for row in self.heard
            if self.frames[row].can_id == samples.can_id and len(self.frames[row].data) == samples.length
        ]  # fmt: skip
        index = samples.signals.index("SampleSequence")
        self._sequences = [samples.decode(self.frames[row].data)[index] for row in self._sample_rows]
        self._status = [row for row in self.answers if self.shown([row], STATUS)]
        self.virtual = not any(self.shown([row], STATUS)["ExecutionTime"] for row in self._status)

    def mark(self, frame: Frame) -> tuple[int, int]:
        """The message and its counter, by which the answers of two ticks are distinguished."""
        protected = self.codecs[frame.can_id].e2e_data_id is not None
        return frame.can_id, frame.data[_COUNTER_BYTE] & _COUNTER_BITS if protected else -1

    def marks(self, rows: Sequence[int]) -> list[tuple[int, int]]:
        """The marks of a tick's answers in the order of identifiers; a frame of another length has none."""
        frames = [self.frames[row] for row in rows]
        return sorted(self.mark(f) for f in frames if len(f.data) == self.codecs[f.can_id].length)

    def shown(self, rows: Sequence[int], message: str) -> dict[str, float]:
        """The signals of a message among these answers; {} when it is not there."""
        for row in rows:
            codec, data = self.codecs[self.frames[row].can_id], self.frames[row].data
            if codec.name == message and len(data) == codec.length:
                return dict(zip(codec.signals, codec.decode(data), strict=True))
        return {}

    def ticks(self, first: int, counts: Sequence[int]) -> list[Tick]:
        """Every whole tick from answer `first` on; counts: answers of each tick, over and over again."""
        cut: list[list[int]] = []
        for count in cycle(counts):
            if len(rows := self.answers[first : first + count]) < count:
                break
            cut.append(rows)
            first += count
        statuses = [self.shown(rows, STATUS) for rows in cut]
        overruns = [int(status.get("Overruns", 0)) for status in statuses]
        started = np.array([self._started_ns(rows) for rows in cut], np.int64)
        due = self._due(started, np.array(overruns)).tolist()
        ticks = []
        for number, (rows, status) in enumerate(zip(cut, statuses, strict=True)):
            row, earliest, latest = self._heard(rows[0], int(started[number]), status.get("EchoSequence"))
            ticks.append(
                Tick(
                    rows=rows,
                    now_ns=due[number],
                    execution_ns=round(status.get("ExecutionTime", 0) * 1000),
                    overruns=overruns[number],
                    heard_before=row,
                    earliest=earliest,
                    latest=latest,
                )
            )
        return ticks

    def _due(self, started_ns: NDArray[np.int64], overruns: NDArray[np.int64]) -> NDArray[np.int64]:
        """When each tick was due [ns]: whole periods apart, however late it started."""
        if self.virtual or not started_ns.size:
            return started_ns
        # a low percentile, not the minimum: a single wrong stamp must not move the whole grid
        grid = (np.arange(started_ns.size) + overruns) * TICK_NS
        return grid + np.int64(np.percentile(started_ns - grid, _PROMPT))

    def _started_ns(self, rows: Sequence[int]) -> int:
        """When the tick of these answers started [ns]: in real time by the execution time in the next status."""
        first_ns, last_ns = self.frames[rows[0]].at_ns, self.frames[rows[-1]].at_ns
        if self.virtual:
            return first_ns
        following = bisect_right(self._status, rows[-1])
        statuses = self._status[following : following + 1]
        return min(first_ns, last_ns - round(self.shown(statuses, STATUS).get("ExecutionTime", 0) * 1000))

    def _heard(self, answer_row: int, started_ns: int, echo: float | None) -> tuple[int, int, int]:
        """The row before which every frame had been received, and its bounds: by the stamps and by the echoed sample."""
        if self.virtual:
            return answer_row, answer_row, answer_row
        row = earliest = latest = answer_row
        while row > 0 and self.frames[row - 1].at_ns > started_ns:
            row -= 1
        after = bisect_left(self._sample_rows, answer_row)
        for newest in range(after - 1, max(after - _ECHOED_WITHIN, 0) - 1, -1):
            if self._sequences[newest] == echo:
                earliest = self._sample_rows[newest] + 1
                latest = self._sample_rows[newest + 1] if newest + 1 < after else answer_row
                return min(max(row, earliest), latest), earliest, latest
        return row, max(answer_row - _OPEN_ROWS, 0), latest


def first_tick(recorded: Recorded, schedule: Sequence[Sequence[Frame]], source: str) -> tuple[int, int]:
    """Number of the first whole tick of an ECU that has received nothing yet, and the index of its first answer.

    schedule: the answers of an ECU that receives nothing, by the number of the tick.
    """
    if not recorded.answers:
        raise LogError(f"{source}: not one frame of {ECU}: no answers to compare with")
    due: dict[tuple[tuple[int, int], ...], int] = {}
    for number, frames in enumerate(schedule):
        due.setdefault(tuple(sorted(map(recorded.mark, frames))), number)
    found: tuple[int, int] | None = None
    state: float | None = None
    for first, row in enumerate(recorded.answers):
        if first > _LOOKED_THROUGH and row > recorded.first_heard:
            break
        for count in {len(frames) for frames in schedule}:
            rows = recorded.answers[first : first + count]
            if (marks := tuple(recorded.marks(rows))) not in due:
                continue
            status = recorded.shown(rows, STATUS)
            state = status.get("State")
            if state == _AT_REST:
                # an ECU that skipped ticks while it started warns for a while; a tick after that is a safer start
                found = found or (due[marks], first)
                if not status["Overruns"] or recorded.shown(rows, "Warnings").get("CycleOverrun") == 0:
                    return due[marks], first
    if found is not None:
        return found
    if state is not None:
        raise LogError(
            f"{source}: begins with the ECU already running ({STATUS}.State is {state:g}): the frames that it received before are "
            "not in the recording; record from before the machine starts"
        )
    raise LogError(
        f"{source}: its first answers fit no tick of an idle ECU: are frames missing, or is it another ECU?"
    )
