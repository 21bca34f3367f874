"""Judges a build in single precision against the Python ECU: how far each estimate is off, and whether another choice is one of rounding.

The reference for rounding is Monte Carlo arithmetic: builds in double precision whose every result is changed at random by up to the
rounding of single precision, with the constants and samples of the single build. Each such *draw* of a drive shows where rounding
decides.

An *estimate* is a measured signal of many steps; its bound is STEPS. A *choice* is everything else: validity, warnings, states,
trouble codes, and what follows from a choice among rates or from the end of a prediction (limits, predicted values); its bound is 0.
Inside the ECU there are choices that no signal shows, such as whether a sample is replaced; estimates beyond their bound come from them.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from bench.microcontroller import Sent
from dbc import loader_database
from tests.deploy.c.test_ecu_in_c import CHOSEN, CHOSEN_SIGNALS

DATABASE = loader_database()
NO_ESTIMATES = (*CHOSEN, "EcuStatus", "ActiveFaults", "PreviousFaults", "FaultFreezeFrame")
LEAST_BITS = 9
"""A signal of fewer is a flag, a state or a count."""
STEPS = 1
"""Of an estimate: the other neighbour of a value that lies between two raw numbers."""
NEAR = 100
"""Ticks around a stretch beyond the bound within which a draw has to be beyond it too: 1 s. Trouble codes are sent ten times a second."""


def is_estimate(message: str, signal: str, bits: int) -> bool:
    """Whether a signal is measured, in many steps."""
    return message not in NO_ESTIMATES and f"{message}.{signal}" not in CHOSEN_SIGNALS and bits >= LEAST_BITS


def estimates() -> Iterator[str]:
    """The names of all estimates, MESSAGE.SIGNAL."""
    for name, codec in DATABASE.by_name.items():
        if "EstimatorEcu" in codec.senders:
            yield from (f"{name}.{s.name}" for s in codec.layout if is_estimate(name, s.name, s.length))


@dataclass(slots=True)
class Difference:
    """Of a build from the Python ECU, over one drive."""

    within: dict[str, int] = field(
        default_factory=lambda: defaultdict(int)
    )  # estimate -> frames, off within its bound
    beyond: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))  # signal -> ticks


def difference_of(found: Sent, expected: Sent) -> Difference:
    """What differs, signal by signal."""
    result = Difference()
    for tick, (ours, theirs) in enumerate(zip(found, expected, strict=True)):
        for (can_id, data), (other_id, other) in zip(ours, theirs, strict=True):
            assert can_id == other_id
            if data == other:
                continue
            codec = DATABASE.by_id[can_id]
            for signal, a, b in zip(codec.layout, codec.decode(data), codec.decode(other), strict=True):
                if a == b or signal.name in ("Crc", "AliveCounter"):
                    continue
                name = f"{codec.name}.{signal.name}"
                measured = is_estimate(codec.name, signal.name, signal.length)
                if measured and abs(round((a - b) / signal.scale)) <= STEPS:
                    result.within[name] += 1
                else:
                    result.beyond[name].append(tick)
    return result


def stretches(ticks: Sequence[int]) -> Iterator[tuple[int, int]]:
    """First and last tick of each; a pause of up to NEAR ends none."""
    ends = [k for k in range(1, len(ticks) + 1) if k == len(ticks) or ticks[k] - ticks[k - 1] > NEAR]
    for begin, end in zip([0, *ends], ends, strict=False):
        yield ticks[begin], ticks[end - 1]


@dataclass(slots=True)
class Figures:
    """One signal over all drives."""

    within: int = 0  # frames in which it is off, within its bound
    beyond: int = 0  # frames in which it is beyond it
    stretches: int = 0  # of these, one after another
    alone: list[tuple[int, int, int]] = field(
        default_factory=list
    )  # drive, first and last tick, where no draw is beyond


@dataclass(slots=True)
class Judged:
    """All drives together."""

    drives: int = 0
    ticks: int = 0
    signals: dict[str, Figures] = field(default_factory=lambda: defaultdict(Figures))

    def add(self, ticks: int, build: Difference, draws: Sequence[Difference]) -> None:
        """One more drive of so many ticks."""
        for name, frames in build.within.items():
            self.signals[name].within += frames
        for name, beyond in build.beyond.items():
            found = self.signals[name]
            found.beyond += len(beyond)
            theirs = [set(draw.beyond.get(name, ())) for draw in draws]
            for first, last in stretches(beyond):
                found.stretches += 1
                near = range(first - NEAR, last + NEAR + 1)
                if not any(tick in each for each in theirs for tick in near):
                    found.alone.append((self.drives, first, last))
        self.drives += 1
        self.ticks += ticks

    def counts(self, names: Iterable[str]) -> tuple[int, int]:
        """Stretches beyond the bound of these signals, and those in which no draw is beyond it."""
        chosen = [self.signals[name] for name in names if name in self.signals]
        return sum(each.stretches for each in chosen), sum(len(each.alone) for each in chosen)

    def choices(self) -> list[str]:
        """Names of the choices that differ anywhere."""
        return sorted(set(self.signals) - set(estimates()))


def estimate_rows(done: Judged) -> Iterator[str]:
    """A row for each estimate."""
    for name in estimates():
        found = done.signals[name]
        message, signal = name.split(".")
        layout = DATABASE.by_name[message].by_signal[signal]
        bound = f"{STEPS * layout.scale:g} {layout.unit}".strip()
        yield f"| {name} | {bound} | {found.within:,} | {found.beyond:,} | {found.stretches:,} | {len(found.alone):,} |"


def choice_rows(done: Judged) -> Iterator[str]:
    """A row for each choice that differs anywhere."""
    for name in done.choices():
        found = done.signals[name]
        yield f"| {name} | {found.beyond:,} | {found.stretches:,} | {len(found.alone):,} |"
