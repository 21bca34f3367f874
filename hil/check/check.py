"""Judges a recording for `loaderhil check`: assigns its frames to the deadlines of DBC files (`hil.timing.deadlines`).

Expected is every cyclic message of every node that sent anything on that channel. A node of a DBC that occurs in the
recording but sent nothing leaves the question open, unless the caller names the nodes that matter.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bus.frame import EXTENDED, EXTENDED_MASK
from dbc.columns import ColumnDecoder
from dbc.database import Database, MessageCodec
from dbc.j1939 import source_address
from dbc.recordings.logfile import Damage, FrameTable
from dbc.tally.contents import Contents, ContentsCount
from dbc.tally.identifiers import Identifiers, Key
from hil.check.contents import judge_contents
from hil.check.message import NO_WAITS, CheckedMessage, Times
from hil.timing.deadlines import (
    QUESTION,
    STALE_AFTER,
    TOLERANCE,
    Judged,
    Observer,
    doubtful,
    only_late,
    overall,
    reasons_for_doubt,
)
from hil.timing.waits import Rows
from hil.verdict import Result, Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """How strictly a recording is judged; see `hil.timing.deadlines`."""

    tolerance: float = TOLERANCE  # permitted deviation of a gap, as a share of the period
    stale_after: float = STALE_AFTER  # periods without a frame after which a value is stale
    nodes: tuple[str, ...] = ()  # senders that matter; () for all
    contents: bool = True
    """Whether contents are judged too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A judged recording."""

    observer: Observer  # the judged window, and reasons to doubt the recording
    messages: tuple[Judged, ...]  # in the order of channels and identifiers
    silent: dict[str, tuple[str, ...]]  # channel -> nodes of its DBC files that sent nothing there
    aperiodic: tuple[str, ...]  # messages without a cycle time
    unknown: int  # frames that no DBC knows
    notes: tuple[str, ...]  # damage of the file that does not affect the verdicts
    overall: Verdict  # on time
    contents: tuple[Contents, ...]  # of messages with and without cycle time
    intact: Verdict  # on the contents

    @property
    def passed(self) -> bool:
        """Whether everything was judged, in time and intact."""
        return self.overall.result is Result.PASSED and self.intact.result is Result.PASSED


class RecordingJudge:
    """Takes the frames of a recording piece by piece, and gives the verdicts on them."""

    def __init__(
        self,
        databases: Sequence[Database],
        rules: Rules = Rules(),
        *,
        since_ns: int | None = None,
        until_ns: int | None = None,
        channel: str | None = None,
        waits: Mapping[str, Mapping[str, Rows]] = NO_WAITS,
    ) -> None:
        """since_ns, until_ns: bounds of the judged stamps; None where all are. channel: the only one. waits: as in `Observer`."""
        self._databases, self._rules, self._waits = databases, rules, waits
        self._since_ns, self._until_ns, self._channel = since_ns, until_ns, channel
        self._identifiers = Identifiers(ColumnDecoder(*databases))
        self._messages: dict[Key, CheckedMessage] = {}
        self._damaged: tuple[Damage, ...] = ()
        self._damaged_count = 0
        self.channels: tuple[str, ...] = ()
        self.first_ns, self.last_ns = np.iinfo(np.int64).max, np.iinfo(np.int64).min

    def take(self, table: FrameTable) -> None:
        """Take the next piece."""
        self.channels = table.channels
        self._damaged += table.damaged
        self._damaged_count += table.damaged_count
        if not len(table):
            return
        self.first_ns = min(self.first_ns, int(table.time_ns.min()))
        self.last_ns = max(self.last_ns, int(table.time_ns.max()))
        chosen = [number for number, name in enumerate(self.channels) if self._channel in (None, name)]
        for key, codec, rows in self._identifiers.rows(table):
            if key[0] not in chosen:
                continue
            if key not in self._messages:
                self._messages[key] = self._message(codec)
            self._messages[key].add(table, self._inside(table, rows))

    def observer(self) -> Observer:
        """From the first stamp to the last; lines that could not be read are frames that the observer lost."""
        # a damaged line is a frame that the recorder lost; a file that just ends early has lost nothing before its end
        lost = self._damaged_count - sum(1 for damage in self._damaged if damage.at_end)
        return Observer(start_ns=self.first_ns, end_ns=self.last_ns, lost=lost)

    def check(self, observer: Observer, named: str | None = None) -> Check:
        """The verdicts. observer: with the window in which all taken frames lie. named: what every channel is called."""
        judged: list[Judged] = []
        contents: list[Contents] = []
        silent: dict[str, tuple[str, ...]] = {}
        aperiodic: set[str] = set()
        unknown = 0
        numbers = [number for number, name in enumerate(self.channels) if self._channel in (None, name)]
        for number in numbers:
            channel = named or self.channels[number]
            groups = {can_id: message for (on, can_id), message in self._messages.items() if on == number}
            unknown += self._identifiers.unknown[number]
            seen = [message.codec for message in groups.values()]
            aperiodic |= {codec.name for codec in seen if not codec.cycle_ns}
            present = {node for codec in seen for node in codec.senders}
            for can_id, message in sorted(groups.items()):
                if message.contents is not None and message.contents.frames:
                    contents.append(message.contents.counted(_name(can_id, message.codec, seen), channel))
            # messages that never came are judged too, with no frame at all: they are late for the whole window
            for can_id, message in sorted({**groups, **self._absent(seen, present)}.items()):
                if message.times is not None:
                    name = _name(can_id, message.codec, seen)
                    judged.append(message.times.judged(name, channel, observer))
            if quiet := tuple(sorted(_nodes(self._databases, seen) - present)):
                silent[channel] = quiet
        conclusion = _concluded(
            judged,
            silent,
            self._rules,
            reasons_for_doubt(observer, late=only_late(judged, observer)),
            several=len(numbers) > 1,
        )
        return Check(
            observer=observer,
            messages=tuple(judged),
            silent=silent,
            aperiodic=tuple(sorted(aperiodic)),
            unknown=unknown,
            notes=tuple(str(damage) for damage in self._damaged if damage.at_end),
            overall=conclusion,
            contents=tuple(contents),
            intact=judge_contents(contents),
        )

    def _message(self, codec: MessageCodec) -> CheckedMessage:
        rules, matters = self._rules, _matters(codec, self._rules)
        timed = bool(codec.cycle_ns) and matters
        times = Times(codec, waits=self._waits, tolerance=rules.tolerance, stale_after=rules.stale_after)
        counted = rules.contents and matters and not codec.is_multiplexed
        return CheckedMessage(codec, times if timed else None, ContentsCount(codec) if counted else None)

    def _inside(self, table: FrameTable, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """The rows whose stamps are judged."""
        for bound_ns, outside in ((self._since_ns, np.less), (self._until_ns, np.greater)):
            if bound_ns is not None:
                rows = rows[~outside(table.time_ns[rows], bound_ns)]
        return rows

    def _absent(self, seen: Sequence[MessageCodec], present: set[str]) -> dict[int, CheckedMessage]:
        """Cyclic messages that a node never sent although it sent others, and may not leave out."""
        return {
            codec.can_id: self._message(codec)
            for database in self._databases
            for codec in database.by_name.values()
            if codec.is_owed and codec not in seen and present.intersection(codec.senders)
        }


def check(
    table: FrameTable, databases: Sequence[Database], rules: Rules = Rules(), *, observer: Observer | None = None
) -> Check:  # fmt: skip
    """The verdicts on a recording. observer: window and reasons for doubt; by default the whole recording and its damage.

    A DBC file without any frame in the recording is ignored.
    """
    judge = RecordingJudge(databases, rules)
    if observer is not None:
        judge = RecordingJudge(
            databases, rules, since_ns=observer.start_ns, until_ns=observer.end_ns, waits=observer.waits
        )
    judge.take(table)
    return judge.check(observer or judge.observer())


def _nodes(databases: Iterable[Database], seen: Sequence[MessageCodec]) -> set[str]:
    """Nodes with cyclic messages of the DBC files that occur."""
    occurring = [database for database in databases if any(c in database.by_name.values() for c in seen)]
    return {n for db in occurring for codec in db.by_name.values() if codec.cycle_ns for n in codec.senders}


def _matters(codec: MessageCodec, rules: Rules) -> bool:
    return not rules.nodes or bool(set(rules.nodes).intersection(codec.senders))


def _name(can_id: int, codec: MessageCodec, seen: Sequence[MessageCodec]) -> str:
    """The message's name; with the source address where several send it."""
    if seen.count(codec) < 2 or not can_id & EXTENDED:
        return codec.name
    return f"{codec.name} from {source_address(can_id & EXTENDED_MASK)}"


def _concluded(
    judged: Sequence[Judged],
    silent: dict[str, tuple[str, ...]],
    rules: Rules,
    doubts: Sequence[str],
    *,
    several: bool,
) -> Verdict:
    """The verdict on all messages; inconclusive when the observer is doubtful or a node that may matter is absent."""
    verdict = overall([one.verdict for one in judged], QUESTION)
    if doubts:
        return doubtful(judged, doubts)
    missing = [
        f"{node} sent nothing{f' on {channel}' if several else ''}"
        for channel, nodes in silent.items()
        for node in nodes
        if not rules.nodes or node in rules.nodes
    ]
    if verdict.result is Result.FAILED or not missing:
        return verdict
    open_question = "is it on this bus? (name the nodes that are: --node)"
    reasons = [f"{', '.join(missing)}: {open_question}"]
    if verdict.result is Result.INCONCLUSIVE and judged:
        reasons.insert(0, verdict.reason)
    return Verdict(question=QUESTION, result=Result.INCONCLUSIVE, reason="; ".join(reasons))
