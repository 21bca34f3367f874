"""One verdict per requirement, with its evidence. Pure: divided recording in, verdicts out."""

import enum
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dbc.columns import decode_rows
from dbc.protection import Checker, Finding
from dbc.tally.contents import not_in_table, outside_range
from hil.check.message import Times
from hil.timing.deadlines import Observer
from hil.verdict import Result, Verdict
from testbench.conform.evidence import Evidence, Traffic

SYSTEMATIC = 0.1
"""Deviation of the median interval from the cycle time, as a share of it, that no busy moment of a host explains."""
ANOTHER = 0.45
"""The same, that no host explains that is busy all the time: it is another cycle time."""
_CRC = (Finding.WRONG_CRC, Finding.MASQUERADED)
_COUNTER = (Finding.LOST, Finding.REPEATED, Finding.REORDERED, Finding.RESTARTED, Finding.WRONG_COUNTER)


class Kind(enum.Enum):
    """What a requirement is about; values are the words of results and page."""

    PRESENCE = "presence"
    CYCLE = "cycle time"
    LENGTH = "length"
    RANGE = "range"
    TABLE = "value table"
    COUNTER = "counter"
    CRC = "CRC"
    INITIAL = "initial values"
    START = "start-up"
    LOSS = "state after loss"
    RECOVERY = "recovery"


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirement:
    """One requirement of the DBC with its verdict. subject: the message, input or node that it is about."""

    kind: Kind
    subject: str
    result: Result
    evidence: str

    @property
    def verdict(self) -> Verdict:
        """As question and reason."""
        return Verdict(
            question=f"{self.subject}: {self.kind.value}", result=self.result, reason=self.evidence
        )


def passed(kind: Kind, subject: str, evidence: str) -> Requirement:
    """It is kept."""
    return Requirement(kind=kind, subject=subject, result=Result.PASSED, evidence=evidence)


def failed(kind: Kind, subject: str, evidence: str) -> Requirement:
    """It is broken."""
    return Requirement(kind=kind, subject=subject, result=Result.FAILED, evidence=evidence)


def unknown(kind: Kind, subject: str, evidence: str) -> Requirement:
    """It cannot be judged from this recording."""
    return Requirement(kind=kind, subject=subject, result=Result.INCONCLUSIVE, evidence=evidence)


def judge_messages(evidence: Evidence) -> Iterator[Requirement]:
    """Everything that each message of the node has to keep by itself."""
    for name, traffic in evidence.own.items():
        yield _presence(name, traffic, evidence)
        if not traffic.rows.size:
            continue  # what is absent has no other property; its absence is the verdict
        if traffic.codec.cycle_ns:
            yield _cycle(name, traffic, evidence)
        yield _length(name, traffic, evidence)
        whole = traffic.rows[evidence.table.length[traffic.rows] == traffic.codec.length]
        if traffic.codec.protection is not None:
            yield from _protection(name, traffic, evidence)
        yield from _values(name, traffic, whole, evidence)


def _presence(name: str, traffic: Traffic, evidence: Evidence) -> Requirement:
    count = int(traffic.rows.size)
    if count:
        return passed(
            Kind.PRESENCE, name, f"{count} frames, the first at {evidence.since(int(traffic.at_ns[0])):.3f} s"
        )
    if not traffic.codec.cycle_ns:
        return unknown(Kind.PRESENCE, name, "sent on events only, and no event was seen")
    # one verdict on the node instead of a failure for each of its messages
    if not evidence.frames:
        return unknown(Kind.PRESENCE, name, f"{evidence.node} sent nothing at all: is it on this bus?")
    if traffic.codec.is_optional:
        return passed(Kind.PRESENCE, name, "never sent, which the DBC permits (SendOptional)")
    return failed(
        Kind.PRESENCE, name, f"never sent, while {evidence.node} sent {evidence.frames} other frames"
    )


def _cycle(name: str, traffic: Traffic, evidence: Evidence) -> Requirement:
    """Gaps one by one, and their median: a wrong cycle time is no matter of a busy moment."""
    period = traffic.codec.cycle_ns
    gaps = np.diff(traffic.at_ns)
    # The window opens with the message's first frame: how soon that comes is a question of the start-up.
    window = Observer(
        start_ns=int(traffic.at_ns[0]),
        end_ns=evidence.observer.end_ns,
        lost=evidence.observer.lost,
        starved=evidence.observer.starved,
    )
    times = Times(traffic.codec)
    times.add(
        evidence.table, traffic.rows[(traffic.at_ns >= window.start_ns) & (traffic.at_ns <= window.end_ns)]
    )
    found = times.judged(name, "", window).verdict
    # ten gaps: the median of fewer may be that of the start-up
    off = abs(float(np.median(gaps)) - period) / period if gaps.size >= 10 else 0.0
    if off > SYSTEMATIC:
        reason = f"every {np.median(gaps) * 1e-6:.1f} ms (median) instead of {period * 1e-6:.0f} ms"
        # a starved bench stamps in bursts: half of the gaps may be short, but the median stays near the cycle
        if evidence.observer.starved and off <= ANOTHER:
            return unknown(Kind.CYCLE, name, f"{reason}; {evidence.observer.starved}")
        return failed(Kind.CYCLE, name, reason)
    # Counters have a requirement of their own; here only times count.
    late = [event for event in found.events if "repeated" not in event and "jump" not in event]
    if not late:
        if found.result is Result.INCONCLUSIVE:
            return unknown(Kind.CYCLE, name, found.reason)
        return passed(
            Kind.CYCLE,
            name,
            f"median {np.median(gaps) * 1e-6:.2f} ms, longest gap {gaps.max() * 1e-6:.2f} ms of {period * 1e-6:.0f} ms",
        )
    at = f" at {evidence.since(found.worst_at_ns):.3f} s" if found.worst_at_ns is not None else ""
    events = ", ".join(late) + at
    if found.result is Result.INCONCLUSIVE:
        return unknown(Kind.CYCLE, name, found.reason)
    # A delayed frame makes the gap before it long and the one after it short, by half a cycle and more where that is an event.
    delay_ns = max((found.worst_gap_ns or 0) - period, period // 2 if found.early else 0)
    # no busy host makes stamps run backwards
    if not found.backwards and (excuse := evidence.excuse(delay_ns)):
        return unknown(Kind.CYCLE, name, f"{events}; {excuse}")
    return failed(Kind.CYCLE, name, events)


def _length(name: str, traffic: Traffic, evidence: Evidence) -> Requirement:
    lengths = evidence.table.length[traffic.rows]
    wrong = lengths != traffic.codec.length
    if not wrong.any():
        return passed(Kind.LENGTH, name, f"{traffic.codec.length} bytes in {lengths.size} frames")
    first = int(np.argmax(wrong))
    return failed(
        Kind.LENGTH,
        name,
        f"{int(wrong.sum())} of {lengths.size} frames, the first with {int(lengths[first])} of {traffic.codec.length} bytes "
        f"at {evidence.since(int(traffic.at_ns[first])):.3f} s",
    )


def _protection(name: str, traffic: Traffic, evidence: Evidence) -> Iterator[Requirement]:
    """CRC and counter of the frames that have the message's length."""
    # the checker of every receiver on the bus: counters depend on the frame before, so rows go in one by one
    checker = Checker(traffic.codec)
    table = evidence.table
    crc: list[tuple[int, str]] = []
    counter: list[tuple[int, str]] = []
    judged = 0
    for row, at_ns in zip(traffic.rows.tolist(), traffic.at_ns.tolist(), strict=True):
        found = checker.check(table.data[row, : table.length[row]].tobytes(), at_ns)
        judged += found is not Finding.WRONG_LENGTH
        if found in _CRC:
            claimed = f" ({checker.claimed})" if checker.claimed else ""
            crc.append((at_ns, found.value + claimed))
        elif found in _COUNTER:
            counter.append((at_ns, found.value))
    for kind, wrong in ((Kind.CRC, crc), (Kind.COUNTER, counter)):
        if not judged:
            yield unknown(kind, name, "no frame of the right length")
        # the counter lies under the CRC: where every CRC is wrong, another rule or DBC made these frames
        elif kind is Kind.COUNTER and len(crc) == judged:
            yield unknown(kind, name, "no frame has a right CRC, so its counter means nothing")
        elif not wrong:
            yield passed(kind, name, f"right in {judged} frames")
        elif kind is Kind.COUNTER and evidence.observer.lost:
            yield unknown(
                kind,
                name,
                f"{len(wrong)} jumps, but the recorder itself lost {evidence.observer.lost} frames",
            )
        else:
            at_ns, what = wrong[0]
            yield failed(
                kind,
                name,
                f"{len(wrong)} of {judged} frames, the first at {evidence.since(at_ns):.3f} s: {what}",
            )


def _values(
    name: str, traffic: Traffic, whole: NDArray[np.int64], evidence: Evidence
) -> Iterator[Requirement]:
    """Ranges and value tables, where the message's signals have any."""
    layout = traffic.codec.layout
    columns = decode_rows(traffic.codec, evidence.table, whole) if whole.size else None
    for kind, rule, concerned in (
        (Kind.RANGE, outside_range, [s for s in layout if s.has_range and not s.choices]),
        (Kind.TABLE, not_in_table, [s for s in layout if s.choices]),
    ):
        if not concerned:
            continue
        if columns is None:
            yield unknown(kind, name, "no frame of the right length")
            continue
        broken = []
        for signal in concerned:
            values = np.asarray(columns.signals[signal.name], float)
            bad = (
                rule(signal, values)
                # NaN stands for signals that this frame does not carry, which is no value outside the range
                if signal.multiplexer is None
                else rule(signal, values) & ~np.isnan(values)
            )
            if bad.any():
                first = int(np.argmax(bad))
                at_s = evidence.since(int(evidence.table.time_ns[whole[first]]))
                value = f"{signal.name} = {values[first]:g} {signal.unit}".rstrip()
                broken.append(f"{value} at {at_s:.3f} s ({int(bad.sum())} of {whole.size} frames)")
        if broken:
            yield failed(kind, name, "; ".join(broken))
        else:
            yield passed(kind, name, f"{len(concerned)} signals in {whole.size} frames")
