"""Judges a build in single precision against the Python ECU: how far each estimate is off, and whether another choice is one of rounding.

The reference for rounding is Monte Carlo arithmetic: builds in double precision whose every result is changed at random by up to the
rounding of single precision. Each such *draw* of a drive shows which estimates and choices rounding moves, and by how much.

An *estimate* is a measured signal of many steps. A *choice* is everything else: validity, warnings, states, trouble codes, and what
follows from a choice among rates or from the end of a prediction (limits, predicted values).
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
APART = 200
"""Ticks after a choice inside the estimators (validity, state, trouble) in which estimates are not compared: 2 s."""
NEAR = 100
"""Ticks around a stretch of another choice within which a draw has to choose otherwise too: 1 s. The codes are sent ten times a second."""
INSIDE = ("EcuStatus.", "ActiveFaults.", "PreviousFaults.")
FACTOR = 2.0
"""Bound of an estimate over the largest difference of any draw: single precision is one more draw, and may be the largest."""


def is_estimate(message: str, signal: str, bits: int) -> bool:
    """Whether a signal is measured, in many steps."""
    return message not in NO_ESTIMATES and f"{message}.{signal}" not in CHOSEN_SIGNALS and bits >= LEAST_BITS


@dataclass(slots=True)
class Difference:
    """Of a build from the Python ECU, over one drive."""

    estimates: dict[str, dict[int, int]] = field(
        default_factory=lambda: defaultdict(dict)
    )  # signal -> tick -> steps
    choices: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))  # signal -> ticks

    def apart(self) -> set[int]:
        """Ticks in which the build is in another situation than Python, or was so lately."""
        inside = (
            ticks for name, ticks in self.choices.items() if name.startswith(INSIDE) or name.endswith("Valid")
        )
        return {later for ticks in inside for at in ticks for later in range(at, at + APART + 1)}


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
                if is_estimate(codec.name, signal.name, signal.length):
                    result.estimates[name][tick] = abs(round((a - b) / signal.scale))
                else:
                    result.choices[name].append(tick)
    return result


def stretches(ticks: Sequence[int]) -> Iterator[tuple[int, int]]:
    """First and last tick of each; a pause of up to NEAR ends none."""
    first = last = None
    for tick in ticks:
        if last is not None and tick - last > NEAR:
            yield first, last
            first = None
        first = tick if first is None else first
        last = tick
    if last is not None:
        yield first, last


@dataclass(slots=True)
class Estimate:
    """One estimate over all drives, in steps of its signal."""

    differ: int = 0
    largest: int = 0
    of_draws: int = 0  # the largest difference of any draw

    @property
    def bound(self) -> int:
        """Steps that single precision may be off."""
        return max(round(FACTOR * self.of_draws), 1)


@dataclass(slots=True)
class Choice:
    """One choice over all drives."""

    ticks: int = 0  # in which it differs
    stretches: int = 0
    alone: list[tuple[int, int, int]] = field(
        default_factory=list
    )  # drive, first and last tick, where no draw differs


@dataclass(slots=True)
class Judged:
    """All drives together."""

    drives: int = 0
    ticks: int = 0
    compared: int = 0  # ticks in which estimates were compared
    estimates: dict[str, Estimate] = field(default_factory=lambda: defaultdict(Estimate))
    choices: dict[str, Choice] = field(default_factory=lambda: defaultdict(Choice))

    def add(self, ticks: int, build: Difference, draws: Sequence[Difference]) -> None:
        """One more drive of so many ticks."""
        apart = build.apart()
        self.compared += ticks - sum(tick < ticks for tick in apart)
        for name, off in build.estimates.items():
            steps = [size for tick, size in off.items() if tick not in apart]
            found = self.estimates[name]
            found.differ, found.largest = found.differ + len(steps), max([found.largest, *steps])
        for draw in draws:
            beside = draw.apart()
            for name, off in draw.estimates.items():
                steps = [size for tick, size in off.items() if tick not in beside]
                self.estimates[name].of_draws = max([self.estimates[name].of_draws, *steps])
        for name, found in build.choices.items():
            choice = self.choices[name]
            choice.ticks += len(found)
            theirs = [set(draw.choices.get(name, ())) for draw in draws]
            for first, last in stretches(found):
                choice.stretches += 1
                near = range(first - NEAR, last + NEAR + 1)
                if not any(tick in ticks_of for ticks_of in theirs for tick in near):
                    choice.alone.append((self.drives, first, last))
        self.drives += 1
        self.ticks += ticks

    def beyond(self) -> list[str]:
        """Estimates that are further off than their bound."""
        return [name for name, found in self.estimates.items() if found.largest > found.bound]


def estimate_rows(done: Judged) -> Iterable[str]:
    """A row for each estimate."""
    for name in sorted(done.estimates):
        found = done.estimates[name]
        message, signal = name.split(".")
        layout = DATABASE.by_name[message].by_signal[signal]
        bound, largest = (
            f"{steps * layout.scale:.4g} {layout.unit}".strip() for steps in (found.bound, found.largest)
        )
        yield f"| {name} | {found.differ:,} | {largest} ({found.largest}) | {found.of_draws} | {bound} ({found.bound}) |"


def choice_rows(done: Judged) -> Iterable[str]:
    """A row for each choice."""
    for name in sorted(done.choices):
        found = done.choices[name]
        yield f"| {name} | {found.ticks:,} | {found.stretches:,} | {len(found.alone):,} |"


def alone(done: Judged) -> int:
    """Stretches of another choice in which no draw chooses otherwise."""
    return sum(len(choice.alone) for choice in done.choices.values())
