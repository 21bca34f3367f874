"""Feeds a recording to the ECU's algorithm and compares its answers with the recorded ones, bit for bit.

Pure: a table in, a result out. Recorded and replayed answers are compared tick by tick (`hil.replay.ticks`). Execution
time and overruns, which a core cannot know, are taken from the recording.

The recording must begin before the ECU received a frame of the machine; how long it had idled by then follows from
its counters.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, takewhile
from typing import Any, Protocol

from bus.frame import Frame
from dbc.database import Database, MessageCodec
from dbc.recordings.logfile import FrameTable
from hil.replay.ticks import TICK_NS, Recorded, Tick, first_tick

CYCLE = 150
"""Ticks after which an idle ECU repeats itself: counters 0..14, cycles of 1 to 10 ticks."""
IDLE_TURNS = (0, 1, 4)
"""Numbers of such cycles to try: an ECU that has just started still has warnings pending, one that idled longer has not."""
MOST_TRIED = 80
"""Other orders of frames tried for one tick; each try starts from the beginning, because a core cannot be copied."""
LOOKED_BACK = 8
"""Ticks after which a frame received one tick earlier or later must have changed the answers."""
_LAST_COMPARED = ("AliveCounter", "Crc")


class Core(Protocol):
    """What is needed of an ECU: `ecu.cycle.EcuCycle`, or a fake."""

    def receive(self, frame: Frame, now_ns: int) -> Sequence[object]: ...

    def tick(self, now_ns: int) -> Any: ...

    def executed(self, execution_ns: int) -> None: ...

    def overran(self, skipped: int) -> None: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """The first answer that differs from the recorded one."""

    row: int  # of the table
    at_s: float  # after the first frame of the recording [s]
    message: str
    signal: str = ""  # '' when the messages themselves differ
    unit: str = ""
    recorded: str
    replayed: str

    def __str__(self) -> str:
        where = f"frame {self.row + 1} at {self.at_s:.6f} s"
        if not self.signal:
            return f"{where}: {self.recorded} recorded where {self.replayed} is due"
        unit = f" {self.unit}" if self.unit else ""
        values = f"{self.recorded}{unit} recorded, {self.replayed}{unit} replayed"
        return f"{where}: {self.message}.{self.signal}: {values}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """The result of a comparison."""

    ticks: int  # equal
    answers: int  # equal
    open_ticks: int  # ticks for which the order of frames had to be found by trying
    difference: Difference | None  # None: everything is equal


def into_ecu(
    table: FrameTable, make: Callable[[], Core], database: Database, source: str = "the recording"
) -> Replayed:
    """Feed a recording into a fresh ECU and compare its answers with the recorded ones, up to the first difference.

    LogError when the recording has no answers, or does not begin with the ECU at rest.
    """
    recorded = Recorded(table, database)
    schedule = [[f for f in frames if f.can_id not in recorded.left_out] for frames in _idle(make(), CYCLE)]
    number, first = first_tick(recorded, schedule, source)
    ticks = recorded.ticks(first, [len(schedule[(number + k) % CYCLE]) for k in range(CYCLE)])
    walks = [_Walk(recorded, ticks, make, number + turns * CYCLE) for turns in IDLE_TURNS]
    return max(walks, key=_Walk.agreeing).result()


def _idle(core: Core, ticks: int) -> list[list[Frame]]:
    """The answers of an ECU that receives nothing, by tick."""
    return [list(core.tick((k + 1) * TICK_NS).frames) for k in range(ticks)]


class _Walk:
    """Steps a core through the recording, with a new core for each order of frames that is tried."""

    def __init__(
        self, recorded: Recorded, ticks: Sequence[Tick], make: Callable[[], Core], idle: int
    ) -> None:
        """idle: ticks of the core, without any received frame, before the first tick."""
        self._recorded, self._ticks, self._make, self._idle = recorded, ticks, make, idle
        self._cuts = [tick.heard_before for tick in ticks]

    def agreeing(self) -> int:
        """Number of ticks that agree if each had received the most likely frames."""
        core = self._fresh()
        return sum(1 for _ in takewhile(lambda k: self._step(core, k) is None, range(len(self._ticks))))

    def result(self) -> Replayed:
        """The result up to the end, or to the first difference that no order of frames explains."""
        core, tried = self._fresh(), 0
        for number in range(len(self._ticks)):
            if (difference := self._step(core, number)) is None:
                continue
            # In real time the bus carries frames while the ECU already computes: the recording does not always show which
            # of the last frames before a tick it had received. In lockstep the order is certain.
            other = None if self._recorded.virtual else self._reordered(number)
            if other is None:
                return self._replayed(number, tried, difference)
            core, tried = other, tried + 1
        return self._replayed(len(self._ticks), tried, None)

    def _replayed(self, ticks: int, tried: int, difference: Difference | None) -> Replayed:
        answers = sum(len(tick.rows) for tick in self._ticks[:ticks])
        return Replayed(ticks=ticks, answers=answers, open_ticks=tried, difference=difference)

    def _fresh(self) -> Core:
        """A core that has idled up to the first tick."""
        core, ticks = self._make(), self._ticks
        if ticks and ticks[0].overruns:
            core.overran(ticks[0].overruns)
        for k in range(self._idle if ticks else 0):
            core.tick(ticks[0].now_ns - (self._idle - k) * TICK_NS)
        return core

    def _step(self, core: Core, number: int) -> Difference | None:
        tick, heard, frames = self._ticks[number], self._recorded.heard, self._recorded.frames
        before = self._ticks[number - 1] if number else tick
        start = bisect_left(heard, self._cuts[number - 1]) if number else 0
        for row in heard[start : bisect_left(heard, self._cuts[number])]:
            core.receive(frames[row], frames[row].at_ns)
        core.executed(tick.execution_ns)
        if tick.overruns > before.overruns:
            core.overran(tick.overruns - before.overruns)
        return _compare(self._recorded, tick.rows, core.tick(tick.now_ns).frames)

    def _reordered(self, number: int) -> Core | None:
        """A core whose answers agree up to a tick if this tick or an earlier one had received more or fewer frames; None if none does.

        A core cannot be copied, so each order is tried from the beginning.
        """
        kept = self._cuts
        for changes in islice(self._other_orders(number), MOST_TRIED):
            self._cuts = [changes.get(k, cut) for k, cut in enumerate(kept)]
            core = self._fresh()
            if all(self._step(core, k) is None for k in range(number + 1)):
                return core
        self._cuts = kept
        return None

    def _other_orders(self, number: int) -> Iterator[dict[int, int]]:
        """Other cuts: for one of the last ticks, the latest first, then for the last two together. Tick -> row."""
        for k in range(number, max(0, number - LOOKED_BACK) - 1, -1):
            yield from ({k: cut} for cut in self._choices(k))
        for before in self._choices(number - 1) if number else ():
            yield from ({number - 1: before, number: cut} for cut in self._choices(number))

    def _choices(self, number: int) -> list[int]:
        """Other possible cuts of a tick, the nearest to the most likely one first."""
        usual, tick = self._cuts[number], self._ticks[number]
        possible = (cut for cut in range(tick.earliest, tick.latest + 1) if cut != usual)
        return sorted(possible, key=lambda cut: abs(cut - usual))


def _compare(recorded: Recorded, rows: Sequence[int], replayed: Sequence[Frame]) -> Difference | None:
    """The first recorded answer of a tick that is not what was replayed."""
    waiting = {frame.can_id: frame for frame in replayed}
    for row in rows:
        frame = recorded.frames[row]
        codec = recorded.codecs[frame.can_id]
        ours = waiting.pop(frame.can_id, None)
        at_s = (frame.at_ns - recorded.frames[0].at_ns) * 1e-9
        if ours is None:
            due = next(iter(waiting), 0)
            name = recorded.codecs[due].name if due in recorded.codecs else "nothing"
            return Difference(row=row, at_s=at_s, message=codec.name, recorded=codec.name, replayed=name)
        if ours.data != frame.data:
            signal, theirs, mine = _first_signal(codec, frame.data, ours.data)
            return Difference(
                row=row, at_s=at_s, message=codec.name, signal=signal,
                unit=codec.by_signal[signal].unit if signal in codec.by_signal else "",
                recorded=theirs, replayed=mine,
            )  # fmt: skip
    return None


def _first_signal(codec: MessageCodec, recorded: bytes, replayed: bytes) -> tuple[str, str, str]:
    """The first signal in which two frames of a message differ, protection last; else their bytes."""
    if len(recorded) >= codec.length:
        pairs = zip(codec.signals, codec.decode(recorded), codec.decode(replayed), strict=True)
        found = [(name, a, b) for name, a, b in pairs if a != b]
        for name, a, b in sorted(found, key=lambda item: item[0] in _LAST_COMPARED):
            return name, f"{a:g}", f"{b:g}"
    return "data", recorded.hex(" "), replayed.hex(" ")
