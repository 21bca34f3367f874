"""The verdicts on two runs. Pure: two run directories in, differences out.

Samples are compared at the stamps of the first run, each with the newest sample of the second one: a receiver holds values too.
"""

import enum
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dbc.columns import Columns
from dbc.signal import Signal
from hil.judgement import timing_of
from hil.rundir import RunDirectory
from hil.timing.measured import Spread
from hil.verdict import Result, Verdict
from testbench.compare.tolerances import Tolerances
from testbench.expect.signals import BusSignal, Series

SENDER = "EstimatorEcu"
_NOT_COMPARED = ("Crc", "AliveCounter", "EchoSequence", "ExecutionTime")
"""Counters and what depends on the computer; timing has verdicts of its own."""
_WARNINGS = ("RollOver", "Warnings")
SHORTEST_S = 0.1
"""Runs that share less than this have nothing to compare."""


class Kind(enum.Enum):
    """What is compared; values are headings."""

    LENGTH = "length"
    ESTIMATE = "estimates"
    WARNING = "warnings"
    STATE = "states"
    TIMING = "timing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One comparison. series: of both runs, for a picture; None where there is none."""

    kind: Kind
    name: str
    result: Result
    reason: str
    series: tuple[Series, Series] | None = None

    @property
    def verdict(self) -> Verdict:
        """As question and reason."""
        return Verdict(question=f"{self.kind.value}: {self.name}", result=self.result, reason=self.reason)


def compare(first: RunDirectory, second: RunDirectory, tolerances: Tolerances) -> tuple[Difference, ...]:
    """Everything that can be compared, in the order of the DBC."""
    return tuple(_differences(first, second, tolerances))


def _differences(one: RunDirectory, other: RunDirectory, tolerances: Tolerances) -> Iterator[Difference]:
    ends = [
        max((float(c.time_s[-1]) for c in run.messages.values() if c.time_s.size), default=0.0)
        for run in (one, other)
    ]
    yield _difference(
        Kind.LENGTH,
        "both runs last as long",
        # two ticks at least: a run may end before or after the frames of its last tick
        abs(ends[0] - ends[1]) <= max(tolerances.moment_s, 0.02),
        f"{ends[0]:.2f} s and {ends[1]:.2f} s",
    )
    # the rest of the longer run has no counterpart; that one is longer has its own verdict
    until_s = min(ends)
    names = [name for name, c in {**one.messages, **other.messages}.items() if SENDER in c.codec.senders]
    for name in dict.fromkeys(names):
        first, second = one.messages.get(name), other.messages.get(name)
        if first is None or second is None or until_s < SHORTEST_S:
            missing = (
                "the runs share no time"
                if first and second
                else f"only in the {'first' if first else 'second'} run"
            )
            # an ECU that leaves it out lacks nothing, and a run may be older than the message
            there = first or second
            left_out = there is not None and there.codec.is_optional and not (first and second)
            missing += "; an ECU may leave it out" if left_out else ""
            yield _difference(Kind.ESTIMATE, name, left_out, missing)
            continue
        for signal in first.codec.layout:
            if signal.name not in _NOT_COMPARED:
                yield _signal(name, signal, first, second, until_s, tolerances)
    yield from _timing(one, other, tolerances)


def _difference(
    kind: Kind, name: str, same: bool, reason: str, series: tuple[Series, Series] | None = None
) -> Difference:
    result = Result.PASSED if same else Result.FAILED
    return Difference(kind=kind, name=name, result=result, reason=reason, series=series)


def _signal(
    message: str, signal: Signal, first: Columns, second: Columns, until_s: float, tolerances: Tolerances
) -> Difference:
    """A number by its difference, a state or flag by its moments of change."""
    named = BusSignal(message, signal)
    a, b = (_series(named, columns, until_s) for columns in (first, second))
    # numbers of states have no distance: degraded is not nearer to fault than running is
    if signal.choices or signal.length == 1:
        kind = Kind.WARNING if message in _WARNINGS else Kind.STATE
        return changes(kind, named, a, b, tolerances.moment_s)
    return numbers(named, a, b, tolerances)


def _series(signal: BusSignal, columns: Columns, until_s: float) -> Series:
    """The samples of the time that both runs have; without what was on the bus before the run began."""

    # `series` takes a run; this is a run of one message
    class Only:
        messages = {signal.message: columns}  # noqa: RUF012
        truth: dict[str, NDArray[np.float64]] = {}  # noqa: RUF012

    series = signal.series(Only())
    empty = np.empty(0)
    return series.between(0.0, until_s) if series is not None else Series(empty, empty)


def _held(series: Series, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """The newest sample at each of these times, NaN before the first; shape of `time_s`."""
    index = np.searchsorted(series.time_s, time_s, side="right") - 1
    return np.where(index >= 0, np.append(series.values, np.nan)[index], np.nan)


def numbers(signal: BusSignal, a: Series, b: Series, tolerances: Tolerances) -> Difference:
    """Root mean square of the difference, and the share of samples that are available."""
    if not a.time_s.size or not b.time_s.size:
        return _difference(
            Kind.ESTIMATE, signal.name, a.time_s.size == b.time_s.size, "no sample in one of the runs"
        )
    other = _held(b, a.time_s)
    known, known_other = ~np.isnan(a.values), ~np.isnan(other)
    share, share_other = float(known.mean()), float(known_other.mean())
    # before the values: an estimate that is missing half of the time may agree where it is there
    if abs(share - share_other) > tolerances.available:
        reason = f"available in {100 * share:.1f} % and {100 * share_other:.1f} % of the samples"
        return _difference(Kind.ESTIMATE, signal.name, False, reason, (a, b))
    both = known & known_other
    if not both.any():
        return _difference(Kind.ESTIMATE, signal.name, True, "never available in both runs")
    values = a.values[both]
    gap = values - other[both]
    rms, largest = float(np.sqrt(np.mean(gap**2))), int(np.argmax(np.abs(gap)))
    # Two steps of the signal are what rounding makes of equal estimates.
    usual = max(tolerances.share * float(np.ptp(values)), 2 * abs(signal.signal.scale))
    permitted = tolerances.signals.get(signal.name, usual)
    unit = f" {signal.unit}" if signal.unit else ""
    reason = (
        f"root mean square {rms:.3g} of {permitted:.3g}{unit} permitted, largest {abs(gap[largest]):.3g}{unit} "
        f"at {a.time_s[both][largest]:.2f} s"
    )
    return _difference(Kind.ESTIMATE, signal.name, rms <= permitted, reason, (a, b))


def changes(kind: Kind, signal: BusSignal, a: Series, b: Series, moment_s: float) -> Difference:
    """The same values in the same order, each at its moment."""
    (times, values), (times_b, values_b) = _moments(a, moment_s), _moments(b, moment_s)
    series = (a, b)
    # order first: moments of two lists that differ cannot be paired
    if values != values_b:
        k = next(
            (k for k, pair in enumerate(zip(values, values_b, strict=False)) if pair[0] != pair[1]),
            min(len(values), len(values_b)),
        )
        words = [
            f"{signal.shown(v[k])} at {t[k]:.2f} s" if k < len(v) else "nothing more"
            for t, v in ((times, values), (times_b, values_b))
        ]
        return _difference(kind, signal.name, False, f"change {k + 1}: {words[0]} and {words[1]}", series)
    if not values:
        return _difference(kind, signal.name, True, "no sample in both runs")
    late = [abs(t - u) for t, u in zip(times, times_b, strict=True)]
    worst = int(np.argmax(late))
    reason = f"{len(values) - 1} changes, at most {1e3 * late[worst]:.0f} ms apart"
    if late[worst] > moment_s + 1e-9:
        reason += f" ({signal.shown(values[worst])} at {times[worst]:.2f} s and {times_b[worst]:.2f} s)"
    return _difference(kind, signal.name, late[worst] <= moment_s + 1e-9, reason, series)


def _moments(series: Series, moment_s: float) -> tuple[list[float], list[float]]:
    """When a value began, and which, the first one included. One that lasts less than `moment_s` is flicker and left out."""
    known = ~np.isnan(series.values)
    time_s, values = series.time_s[known], series.values[known]
    if not values.size:
        return [], []
    # runs of one value: where each begins, and how long it lasts; the last one is taken as long enough
    starts = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1))
    lasts = np.diff(np.append(time_s[starts], time_s[-1] + moment_s))
    kept_t: list[float] = []
    kept_v: list[float] = []
    for start, long in zip(starts.tolist(), (lasts >= moment_s - 1e-9).tolist(), strict=True):
        value = float(values[start])
        # a value before and after a flicker is one stay, not two
        if long and (not kept_v or kept_v[-1] != value):
            kept_t.append(float(time_s[start]))
            kept_v.append(value)
    if kept_t:
        kept_t[0] = 0.0  # what stands from the beginning did not change
    return kept_t, kept_v


def _timing(one: RunDirectory, other: RunDirectory, tolerances: Tolerances) -> Iterator[Difference]:
    """Reaction and ticks: the second run may not be slower than tolerated."""
    if one.record.mode != other.record.mode:
        reason = f"one run is {one.record.mode}, the other {other.record.mode}: their times say nothing about each other"
        yield Difference(kind=Kind.TIMING, name="reaction", result=Result.INCONCLUSIVE, reason=reason)
        return
    a, b = timing_of(one), timing_of(other)
    yield _slower("reaction", a.reaction, b.reaction, tolerances)
    for process in sorted(set(a.execution) & set(b.execution)):
        yield _slower(
            f"{process}: execution time of a tick", a.execution[process], b.execution[process], tolerances
        )


def _slower(name: str, a: Spread, b: Spread, tolerances: Tolerances) -> Difference:
    if not a.count or not b.count:
        reason = f"measured {a.count} and {b.count} times"
        result = Result.PASSED if a.count == b.count else Result.INCONCLUSIVE
        return Difference(kind=Kind.TIMING, name=name, result=result, reason=reason)
    # p99 and not the maximum: one wait for a processor would fail two runs of the same program. The share is for slow
    # ticks, the milliseconds for fast ones, where jitter of the clock is a large share
    permitted = a.p99 * (1 + tolerances.timing) + tolerances.timing_ms * 1e6
    reason = (
        f"median {a.median * 1e-6:.2f} and {b.median * 1e-6:.2f} ms, p99 {a.p99 * 1e-6:.2f} and {b.p99 * 1e-6:.2f} ms of "
        f"{permitted * 1e-6:.2f} ms permitted"
    )
    return _difference(Kind.TIMING, name, b.p99 <= permitted, reason)
