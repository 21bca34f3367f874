"""Requirements on the node's conduct: initial values, start-up, states after loss of inputs, recovery. Pure.

A loss is read from the recording itself: an input that is not seen for longer than its InputTimeout. So a recording of a
drive is judged like one of a live test; what was never lost there is inconclusive.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from dbc.columns import decode_rows
from dbc.database import MessageCodec
from testbench.conform.evidence import Evidence, Traffic
from testbench.conform.requirements import Kind, Requirement, failed, passed, unknown

NS = 1e-6
"""Milliseconds per nanosecond."""


@dataclass(frozen=True, slots=True)
class Loss:
    """An input stayed away: last frame before and first one after [ns]; until the end of the recording: None."""

    last_ns: int
    back_ns: int | None


def judge_conduct(evidence: Evidence) -> Iterator[Requirement]:
    """All requirements on the node's conduct that its DBC makes."""
    yield from _initial_values(evidence)
    # the state of the node is what all requirements below look at; a DBC that names no signal for it asks nothing
    conduct = evidence.database.nodes.get(evidence.node)
    if conduct is None or evidence.states is None:
        return
    if conduct.start_ns:
        yield _start_up(evidence, conduct.running, conduct.start_ns)
    # an input without InputLossState may go without the DBC asking for anything
    asked = {name: t for name, t in evidence.inputs.items() if t.codec.conduct.state}
    losses = {name: _losses(traffic, evidence) for name, traffic in asked.items()}
    for name, traffic in asked.items():
        alone = [
            loss for loss in losses[name] if not _others_lost(name, loss, asked, losses, conduct.running)
        ]
        yield _after_loss(evidence, name, traffic.codec, alone, conduct.running)
        # an input that must not change the state has nothing to recover from
        if conduct.recovery_ns and traffic.codec.conduct.state != conduct.running:
            yield _recovery(evidence, name, alone, conduct.running, conduct.recovery_ns)
    yield from _all_lost(evidence, asked, losses, conduct.running, conduct.recovery_ns)


def _initial_values(evidence: Evidence) -> Iterator[Requirement]:
    """The first frame of each message whose signals have start values."""
    for name, traffic in evidence.own.items():
        started = [signal for signal in traffic.codec.layout if signal.start_value is not None]
        if not started or (traffic.codec.is_optional and not traffic.rows.size):
            continue
        if not evidence.from_start:
            yield unknown(Kind.INITIAL, name, "the node ran before: switch it on while conform waits for it")
            continue
        first = traffic.rows[:1]
        if not first.size or evidence.table.length[first[0]] != traffic.codec.length:
            yield unknown(Kind.INITIAL, name, "no first frame of the right length")
            continue
        values = decode_rows(traffic.codec, evidence.table, first).signals
        wrong = []
        for signal in started:
            assert signal.start_value is not None
            wanted = signal.start_value * signal.scale + signal.offset
            # half a step: both sides were rounded to raw values of this scale
            if abs(float(values[signal.name][0]) - wanted) > abs(signal.scale) / 2:
                wrong.append(
                    f"{signal.name} = {values[signal.name][0]:g}, start value {wanted:g} {signal.unit}".rstrip()
                )
        if wrong:
            yield failed(Kind.INITIAL, name, "first frame: " + "; ".join(wrong))
        else:
            yield passed(Kind.INITIAL, name, ", ".join(signal.name for signal in started))


def _start_up(evidence: Evidence, running: str, within_ns: int) -> Requirement:
    """From the moment at which node and all inputs are there, to `running`."""
    subject = evidence.node
    # inputs whose loss leaves the node running are not needed for its start either
    needed = [t for t in evidence.inputs.values() if t.codec.conduct.state not in ("", running)]
    if not evidence.from_start:
        return unknown(Kind.START, subject, "the node ran before: switch it on while conform waits for it")
    if not evidence.frames or any(not traffic.at_ns.size for traffic in needed):
        return unknown(Kind.START, subject, "the node or one of its inputs is not in the recording")
    # the time counts from the last one to arrive: before that the node has no chance
    there_ns = max(evidence.observer.start_ns, *(int(traffic.at_ns[0]) for traffic in needed))
    # a recording that was cut before the deadline cannot show that it was missed
    if evidence.observer.end_ns - there_ns < within_ns:
        return unknown(Kind.START, subject, "the recording ends before its time to start is over")
    took_ns = _first(evidence, running, there_ns)
    if took_ns is not None and took_ns <= within_ns:
        return passed(Kind.START, subject, f"{running} {took_ns * NS:.0f} ms after all inputs were there")
    if took_ns is not None and (excuse := evidence.excuse(took_ns - within_ns)):
        return unknown(Kind.START, subject, f"{running} after {took_ns * NS:.0f} ms; {excuse}")
    reached = f"{running} after {took_ns * NS:.0f} ms" if took_ns is not None else f"never {running}"
    return failed(
        Kind.START, subject, f"{reached}; permitted are {within_ns * NS:.0f} ms ({_seen(evidence)})"
    )


def _first(evidence: Evidence, state: str, from_ns: int) -> int | None:
    """Time from `from_ns` to the first frame that says this state [ns]."""
    assert evidence.states is not None
    at_ns, values = evidence.states
    names = evidence.state_names
    wanted = [value for value, name in names.items() if name == state]
    # a value table may give one name to several values
    hits = at_ns[(at_ns >= from_ns) & np.isin(values, wanted)]
    return int(hits[0]) - from_ns if hits.size else None


def _seen(evidence: Evidence) -> str:
    """The states that occurred, in words."""
    assert evidence.states is not None
    names = evidence.state_names
    return "states seen: " + (
        ", ".join(names.get(v, str(v)) for v in np.unique(evidence.states[1]).tolist()) or "none"
    )


def _losses(traffic: Traffic, evidence: Evidence) -> list[Loss]:
    """Where an input stayed away for longer than its timeout."""
    timeout_ns = traffic.codec.conduct.timeout_ns
    at_ns = traffic.at_ns
    found = [
        Loss(int(at_ns[k]), int(at_ns[k + 1])) for k in np.flatnonzero(np.diff(at_ns) > timeout_ns).tolist()
    ]
    # lost for good: no later frame closes this gap
    if at_ns.size and evidence.observer.end_ns - int(at_ns[-1]) > timeout_ns:
        found.append(Loss(int(at_ns[-1]), None))
    return found


def _others_lost(
    name: str, loss: Loss, asked: Mapping[str, Traffic], losses: Mapping[str, list[Loss]], running: str
) -> bool:
    """Whether another input that matters was lost or not there meanwhile: then the state may be that one's."""
    end_ns = loss.back_ns if loss.back_ns is not None else 1 << 62
    for other, traffic in asked.items():
        # the loss of such an input changes nothing, so that the state is still this one's
        if other == name or traffic.codec.conduct.state == running:
            continue
        # an input that has not come yet asks for its state as a lost one does
        if not traffic.at_ns.size or int(traffic.at_ns[0]) > loss.last_ns:
            return True
        if any(
            each.last_ns < end_ns and (each.back_ns is None or each.back_ns > loss.last_ns)
            for each in losses[other]
        ):
            return True
    return False


def _after_loss(
    evidence: Evidence, name: str, codec: MessageCodec, losses: list[Loss], running: str
) -> Requirement:
    """The state at the timeout, and from then on until the input is back."""
    wanted, timeout_ns = codec.conduct.state, codec.conduct.timeout_ns
    subject = f"loss of {name}"
    judged = []
    for loss in losses:
        problem, took_ns = _state_in(evidence, loss, wanted, timeout_ns, running)
        if problem and took_ns is not None and (excuse := evidence.excuse(took_ns - timeout_ns)):
            return unknown(Kind.LOSS, subject, f"{problem}; {excuse}")
        if problem:
            # one wrong loss decides: a state that is only sometimes right is not right
            return failed(Kind.LOSS, subject, f"lost at {evidence.since(loss.last_ns):.3f} s: {problem}")
        if took_ns is not None:
            judged.append(took_ns)
    if not judged:
        return unknown(Kind.LOSS, subject, f"{name} was never lost alone while the node was {running}")
    if wanted == running:
        return passed(Kind.LOSS, subject, f"stays {running}, as it must")
    return passed(
        Kind.LOSS,
        subject,
        f"{wanted} after {max(judged) * NS:.0f} ms at most; permitted are {timeout_ns * NS:.0f} ms",
    )


def _state_in(
    evidence: Evidence, loss: Loss, wanted: str, timeout_ns: int, running: str
) -> tuple[str, int | None]:
    """What is wrong with the state during a loss, '' for nothing; and when the right one came [ns], None for never.

    Nothing wrong and None: the loss shows nothing.
    """
    assert evidence.states is not None
    at_ns, values = evidence.states
    names = evidence.state_names
    before = values[at_ns <= loss.last_ns]
    # a node that was not running before shows nothing by what it says afterwards
    if not before.size or names.get(int(before[-1])) != running:
        return "", None
    end_ns = loss.back_ns if loss.back_ns is not None else evidence.observer.end_ns
    inside = (at_ns > loss.last_ns) & (at_ns <= end_ns)
    times, states = at_ns[inside] - loss.last_ns, values[inside]
    if not times.size:
        return "no state was sent meanwhile", None
    # by name: two raw values of the table may mean the same state
    right = np.array([names.get(value) == wanted for value in states.tolist()])
    # until the timeout the node may not have noticed; from then on every frame has to be right
    due = times >= timeout_ns
    if wanted == running:
        # staying as it was has no time of its own: also the frames before the timeout count
        due = np.ones(times.size, bool)
    # the input was back before the first frame that counts
    if not due.any():
        return "", None
    if not right[due].all():
        first = int(np.flatnonzero(due & ~right)[0])
        return (
            f"{names.get(int(states[first]), states[first])} after {times[first] * NS:.0f} ms, {wanted} is required "
            f"within {timeout_ns * NS:.0f} ms"
        ), int(times[np.argmax(right)]) if right[-1] and wanted != running else None
    return "", int(times[np.argmax(right)])


def _recovery(evidence: Evidence, name: str, losses: list[Loss], running: str, within_ns: int) -> Requirement:
    """From the return of a lost input to `running`."""
    subject = f"return of {name}"
    worst = -1
    for loss in losses:
        if loss.back_ns is None:
            continue
        took_ns = _first(evidence, running, loss.back_ns)
        if took_ns is not None and took_ns <= within_ns:
            worst = max(worst, took_ns)
        elif took_ns is not None and (excuse := evidence.excuse(took_ns - within_ns)):
            return unknown(Kind.RECOVERY, subject, f"{running} after {took_ns * NS:.0f} ms; {excuse}")
        elif evidence.observer.end_ns - loss.back_ns >= within_ns:
            again = "never again" if took_ns is None else f"after {took_ns * NS:.0f} ms"
            return failed(
                Kind.RECOVERY,
                subject,
                f"back at {evidence.since(loss.back_ns):.3f} s, {running} {again}; permitted are {within_ns * NS:.0f} ms",
            )
    if worst < 0:
        return unknown(Kind.RECOVERY, subject, f"{name} was never lost alone and came back")
    return passed(Kind.RECOVERY, subject, f"{running} after {worst * NS:.0f} ms at most")


def _all_lost(
    evidence: Evidence,
    asked: Mapping[str, Traffic],
    losses: Mapping[str, list[Loss]],
    running: str,
    within_ns: int,
) -> Iterator[Requirement]:
    """All inputs lost at once, where they ask for one and the same state."""
    matter = {name: t for name, t in asked.items() if t.codec.conduct.state != running}
    states = {t.codec.conduct.state for t in matter.values()}
    # one input is judged above; inputs that ask for different states leave open which one holds for all
    if len(matter) < 2 or len(states) != 1:
        return
    subject, wanted = "loss of all inputs", states.pop()
    timeout_ns = max(t.codec.conduct.timeout_ns for t in matter.values())
    common = None
    for loss in next(iter(losses[name] for name in matter)):
        others = [_overlapping(loss, losses[name]) for name in matter]
        if all(each is not None for each in others):
            # all are lost from the last loss to the first return; recovery needs all of them back, hence the last
            # return
            last = max(each.last_ns for each in others if each is not None)
            backs = [each.back_ns for each in others if each is not None]
            common = Loss(last, None if None in backs else max(b for b in backs if b is not None))
    if common is None:
        yield unknown(Kind.LOSS, subject, "the inputs were never lost together")
        return
    # Losses begin one after the other, so the node may be in the required state before the last one.
    assert evidence.states is not None
    at_ns, values = evidence.states
    end_ns = common.back_ns if common.back_ns is not None else evidence.observer.end_ns
    # the longest timeout of all: no earlier state is required of every node
    inside = (at_ns >= common.last_ns + timeout_ns) & (at_ns <= end_ns)
    names = evidence.state_names
    seen = {names.get(v, str(v)) for v in values[inside].tolist()}
    if not seen:
        yield failed(Kind.LOSS, subject, f"no state was sent after {evidence.since(common.last_ns):.3f} s")
    elif seen != {wanted}:
        yield failed(
            Kind.LOSS,
            subject,
            f"{', '.join(sorted(seen))} instead of {wanted} after {timeout_ns * NS:.0f} ms",
        )
    else:
        yield passed(
            Kind.LOSS, subject, f"{wanted} in all {int(inside.sum())} frames after {timeout_ns * NS:.0f} ms"
        )
    if common.back_ns is not None and within_ns:
        yield _recovery(evidence, "all inputs", [common], running, within_ns)


def _overlapping(loss: Loss, others: list[Loss]) -> Loss | None:
    """The loss among others that shares time with this one."""
    end_ns = loss.back_ns if loss.back_ns is not None else 1 << 62
    for each in others:
        if each.last_ns < end_ns and (each.back_ns is None or each.back_ns > loss.last_ns):
            return each
    return None
