"""Judges a recording for `loaderhil check`: assigns its frames to the deadlines of DBC files (`hil.timing.deadlines`).

Expected is every cyclic message of every node that sent anything on that channel. A node of a DBC that occurs in the
recording but sent nothing leaves the question open, unless the caller names the nodes that matter.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, EXTENDED, EXTENDED_MASK, REMOTE
from dbc.columns import ColumnDecoder
from dbc.database import Database, MessageCodec
from dbc.j1939 import source_address
from dbc.recordings.logfile import FrameTable
from hil.check.contents import Contents, contents_of, judge_contents
from hil.timing.deadlines import (
    COUNTER_MODULUS,
    QUESTION,
    STALE_AFTER,
    TOLERANCE,
    Judged,
    Observation,
    Observer,
    doubtful,
    judge_message,
    only_late,
    overall,
    reasons_for_doubt,
    same_as_before,
)
from hil.verdict import Result, Verdict

_COUNTER_BYTE, _COUNTER_BITS = 1, 0x0F  # AUTOSAR E2E profile 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """How strictly a recording is judged; see `hil.timing.deadlines`."""

    tolerance: float = TOLERANCE  # permitted deviation of a gap, as a share of the period
    stale_after: float = STALE_AFTER  # periods without a frame after which a value is stale
    nodes: tuple[str, ...] = ()  # senders that matter; () for all
    contents: bool = True
    """Whether contents are judged too; without it 0.2 us per frame instead of 3 to 4 (82 300 frames, 2 cores)."""


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


def check(
    table: FrameTable, databases: Sequence[Database], rules: Rules = Rules(), *, observer: Observer | None = None
) -> Check:  # fmt: skip
    """The verdicts on a recording. observer: window and reasons for doubt; by default the whole recording and its damage.

    A DBC file without any frame in the recording is ignored.
    """
    observer = observer or whole(table)
    decoder = ColumnDecoder(*databases)
    judged: list[Judged] = []
    contents: list[Contents] = []
    silent: dict[str, tuple[str, ...]] = {}
    aperiodic: set[str] = set()
    unknown = 0
    for number, channel in enumerate(table.channels):
        rows = np.flatnonzero(table.channel == number)
        # by identifier, not by message: two senders of one J1939 group would look like one that is twice as fast
        groups = dict(_by_identifier(table, rows, decoder))
        unknown += rows.size - sum(found.size for _, found in groups.values())
        aperiodic |= {codec.name for codec, _ in groups.values() if not codec.cycle_ns}
        seen = [codec for codec, _ in groups.values()]
        present = {node for codec in seen for node in codec.senders}
        # messages that never came are judged too, with no frame at all: they are late for the whole window
        wanted = {**groups, **_absent(databases, seen, present)}
        for can_id, (codec, found) in sorted(groups.items()):
            inside = (table.time_ns[found] >= observer.start_ns) & (table.time_ns[found] <= observer.end_ns)
            if rules.contents and inside.any() and not codec.is_multiplexed and _matters(codec, rules):
                contents.append(
                    contents_of(_name(can_id, codec, groups), channel, codec, table, found[inside])
                )
        for can_id, (codec, found) in sorted(wanted.items()):
            if codec.cycle_ns and _matters(codec, rules):
                name = _name(can_id, codec, groups)
                seen_of = observation(name, codec, table, found, observer)
                verdict = judge_message(
                    seen_of, observer, tolerance=rules.tolerance, stale_after=rules.stale_after
                )
                judged.append(Judged(channel=channel, sender=seen_of.sender, verdict=verdict))
        if quiet := tuple(sorted(_nodes(databases, seen) - present)):
            silent[channel] = quiet
    conclusion = _concluded(
        judged,
        silent,
        rules,
        reasons_for_doubt(observer, late=only_late(judged, observer)),
        several=len(table.channels) > 1,
    )
    return Check(
        observer=observer,
        messages=tuple(judged),
        silent=silent,
        aperiodic=tuple(sorted(aperiodic)),
        unknown=unknown,
        notes=tuple(str(damage) for damage in table.damaged if damage.at_end),
        overall=conclusion,
        contents=tuple(contents),
        intact=judge_contents(contents),
    )


def whole(table: FrameTable, starved: str = "") -> Observer:
    """From the first stamp to the last; lines that could not be read are frames that the observer lost."""
    # a damaged line is a frame that the recorder lost; a file that just ends early has lost nothing before its end
    lost = table.damaged_count - sum(1 for damage in table.damaged if damage.at_end)
    return Observer(
        start_ns=int(table.time_ns.min()), end_ns=int(table.time_ns.max()), lost=lost, starved=starved
    )


def observation(
    name: str, codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64], observer: Observer
) -> Observation:
    """What the rows of one message show within the observer's window."""
    stamps = table.time_ns[rows]
    rows = rows[(stamps >= observer.start_ns) & (stamps <= observer.end_ns)]
    protection = codec.protection
    protected = protection is not None and protection.counters > 1
    modulus = protection.counters if protection is not None else COUNTER_MODULUS
    return Observation(
        name=name,
        period_ns=codec.cycle_ns or None,
        at_ns=table.time_ns[rows],
        counters=_counters(codec, table, rows) if protected else None,
        modulus=modulus,
        same_payload=same_as_before(table.data[rows]) if protected else None,
        sender=next(iter(codec.senders), ""),
    )


def _counters(codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """The alive counter of each row, (n,)."""
    protection = codec.protection
    if protection is None or codec.profile is not None:
        return (table.data[rows, _COUNTER_BYTE] & _COUNTER_BITS).astype(np.int64)
    # A user's hook reads one frame at a time, and only frames of the message's length.
    whole = table.data[rows, : codec.length]
    lengths = table.length[rows].tolist()
    read = (
        protection.counter(row.tobytes()) if length == codec.length else protection.counters
        for row, length in zip(whole, lengths, strict=True)
    )
    return np.fromiter(read, np.int64, rows.size)


def _by_identifier(
    table: FrameTable, rows: NDArray[np.int64], decoder: ColumnDecoder
) -> Iterator[tuple[int, tuple[MessageCodec, NDArray[np.int64]]]]:
    """Identifier, its message and its rows, for what a DBC knows."""
    for can_id in np.unique(table.can_id[rows]).tolist():
        codec = None if can_id & (ERROR | REMOTE) else decoder.codec_of(can_id)
        if codec is not None:
            yield can_id, (codec, rows[table.can_id[rows] == can_id])


def _absent(
    databases: Iterable[Database], seen: Sequence[MessageCodec], present: set[str]
) -> dict[int, tuple[MessageCodec, NDArray[np.int64]]]:
    """Cyclic messages that a node never sent although it sent others, and may not leave out."""
    none = np.empty(0, np.int64)
    return {
        codec.can_id: (codec, none)
        for database in databases
        for codec in database.by_name.values()
        if codec.is_owed and codec not in seen and present.intersection(codec.senders)
    }


def _nodes(databases: Iterable[Database], seen: Sequence[MessageCodec]) -> set[str]:
    """Nodes with cyclic messages of the DBC files that occur."""
    occurring = [database for database in databases if any(c in database.by_name.values() for c in seen)]
    return {n for db in occurring for codec in db.by_name.values() if codec.cycle_ns for n in codec.senders}


def _matters(codec: MessageCodec, rules: Rules) -> bool:
    return not rules.nodes or bool(set(rules.nodes).intersection(codec.senders))


def _name(can_id: int, codec: MessageCodec, groups: dict[int, tuple[MessageCodec, NDArray[np.int64]]]) -> str:
    """The message's name; with the source address where several send it."""
    same = sum(1 for other, _ in groups.values() if other is codec)
    if same < 2 or not can_id & EXTENDED:
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
