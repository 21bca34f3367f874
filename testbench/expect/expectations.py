"""The kinds of expectations and how each is judged. Pure: evidence in, a verdict out.

A signal that never came, or a window without a sample, gives INCONCLUSIVE: such an expectation is not passed, and the controller
is not accused either.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from hil.timing.measured import reactions
from hil.verdict import ROLLED_RAD, SLACK_S, WHEELS, Result, Verdict, first_lift_off, first_true
from testbench.expect.condition import Condition
from testbench.expect.evidence import Evidence
from testbench.expect.signals import AnySignal, Series, Source

ROUNDING_S: Final = 1e-9
"""Stamps are whole nanoseconds; as float seconds their differences are off by less."""


class Expectation(Protocol):
    """One pass criterion of a run."""

    @property
    def question(self) -> str:
        """The expectation in plain text, as reports print it."""

    def judge(self, evidence: Evidence) -> Verdict:
        """The verdict on a run."""


@dataclass(frozen=True, slots=True)
class Window:
    """The part of a run in which an expectation is judged [s]; both ends included."""

    from_s: float = 0.0
    to_s: float = math.inf

    def __str__(self) -> str:
        if self.from_s <= 0 and math.isinf(self.to_s):
            return ""
        if math.isinf(self.to_s):
            return f" from {self.from_s:g} s on"
        return f" from {self.from_s:g} s to {self.to_s:g} s"

    def of(self, series: Series) -> Series:
        """The samples within."""
        return series.between(self.from_s - SLACK_S, self.to_s + SLACK_S)


def passed(question: str, reason: str) -> Verdict:
    """It was as expected."""
    return Verdict(question=question, result=Result.PASSED, reason=reason)


def failed(question: str, reason: str) -> Verdict:
    """It was not."""
    return Verdict(question=question, result=Result.FAILED, reason=reason)


def open_question(question: str, reason: str) -> Verdict:
    """It cannot be judged from this run."""
    return Verdict(question=question, result=Result.INCONCLUSIVE, reason=reason)


def nothing_of(signal: AnySignal, window: Window) -> str:
    """The reason of a verdict for which no sample exists."""
    return f"no {signal.name}{window}"


@dataclass(frozen=True, slots=True)
class NoLiftOff:
    """Every wheel stays on the ground, by the plant's truth; contact losses shorter than 50 ms count as wheel hop."""

    window: Window = Window()

    @property
    def question(self) -> str:
        return f"no wheel lifts{self.window}"

    def judge(self, evidence: Evidence) -> Verdict:
        truth = evidence.truth
        # a foreign plant has no truth, a run that was killed at once has an empty one
        if "normal_force" not in truth or not truth["time_s"].size:
            return open_question(self.question, "the run has no truth")
        time_s = np.asarray(truth["time_s"], float)
        inside = (time_s >= self.window.from_s) & (time_s <= self.window.to_s)
        if not inside.any():
            return open_question(self.question, f"the run ended at {time_s[-1]:.2f} s")
        force = np.asarray(truth["normal_force"], float)
        lift = first_lift_off(time_s[inside], force[inside])
        if lift is not None:
            return failed(self.question, f"{WHEELS[lift[1]]} lifts at {lift[0]:.2f} s")
        # over the loads of the first sample; the margin of the roll-over verdict is over those on level ground, from
        # run.json
        least = float(np.min(force[inside] / force[0]))
        return passed(self.question, f"every wheel keeps at least {100 * least:.0f} % of its standing load")


@dataclass(frozen=True, slots=True)
class NoRollOver:
    """The machine's true roll angle stays below 45 degrees."""

    window: Window = Window()

    @property
    def question(self) -> str:
        return f"the machine does not roll over{self.window}"

    def judge(self, evidence: Evidence) -> Verdict:
        truth = evidence.truth
        if "roll" not in truth or not truth["time_s"].size:
            return open_question(self.question, "the run has no truth")
        time_s, roll = np.asarray(truth["time_s"], float), np.abs(np.asarray(truth["roll"], float))
        inside = (time_s >= self.window.from_s) & (time_s <= self.window.to_s)
        if not inside.any():
            return open_question(self.question, f"the run ended at {time_s[-1]:.2f} s")
        over_s = first_true(time_s[inside], roll[inside] > ROLLED_RAD)
        if over_s is not None:
            return failed(self.question, f"it passes 45° at {over_s:.2f} s")
        return passed(self.question, f"largest roll angle {math.degrees(float(roll[inside].max())):.1f}°")


@dataclass(frozen=True, slots=True)
class InBounds:
    """A signal stays within bounds. A value that is not available is outside."""

    signal: AnySignal
    minimum: float  # in the signal's unit; -inf: no bound
    maximum: float
    window: Window = Window()
    ignore_s: float = 0.0  # excursions of at most this length are ignored [s]

    @property
    def question(self) -> str:
        low = "" if math.isinf(self.minimum) else f"{self.minimum:g} <= "
        high = "" if math.isinf(self.maximum) else f" <= {self.maximum:g}"
        unit = f" {self.signal.unit}" if self.signal.unit else ""
        return f"{low}{self.signal.name}{high}{unit}{self.window}"

    def judge(self, evidence: Evidence) -> Verdict:
        series = self.signal.series(evidence)
        seen = self.window.of(series) if series is not None else None
        if seen is None or not seen.time_s.size:
            return open_question(self.question, nothing_of(self.signal, self.window))
        outside = ~(
            (seen.values >= self.minimum) & (seen.values <= self.maximum)
        )  # written so that NaN is outside
        worst = longest_excursion(seen.time_s, outside, self.ignore_s)
        if worst is None:
            low, high = np.nanmin(seen.values), np.nanmax(seen.values)
            return passed(self.question, f"{self.signal.shown(low)} to {self.signal.shown(high)}")
        first, last = worst
        value = _farthest(seen.values[first : last + 1], self.minimum, self.maximum)
        return failed(
            self.question,
            f"{self.signal.shown(value)} between {seen.time_s[first]:.2f} s and {seen.time_s[last]:.2f} s",
        )


def longest_excursion(
    time_s: NDArray[np.float64], condition: NDArray[np.bool_], ignore_s: float
) -> tuple[int, int] | None:
    """First and last index of the longest unbroken interval of `condition` that lasts longer than `ignore_s` [s]."""
    edges = np.diff(np.concatenate(([False], condition, [False])).astype(np.int8))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    if not starts.size:
        return None
    # an interval lasts until the first sample after it: a single bad sample lasts one period, not zero
    until = time_s[np.minimum(stops + 1, time_s.size - 1)]
    lasts = until - time_s[starts]
    # with ignore_s = 0 every excursion counts, also the one at the last sample, whose length is not known
    if ignore_s > 0:
        kept = lasts > ignore_s + ROUNDING_S
        starts, stops, lasts = starts[kept], stops[kept], lasts[kept]
    if not starts.size:
        return None
    worst = int(np.argmax(lasts))
    return int(starts[worst]), int(stops[worst])


def _farthest(values: NDArray[np.float64], minimum: float, maximum: float) -> float:
    """The value that is farthest outside; NaN if none is available."""
    known = values[~np.isnan(values)]
    if not known.size:
        return math.nan
    beyond = np.maximum(minimum - known, known - maximum)
    return float(known[np.argmax(beyond)])


@dataclass(frozen=True, slots=True)
class InStates:
    """A signal has one of some values for at least a share of the window's samples."""

    signal: AnySignal
    states: tuple[float, ...]
    window: Window = Window()
    least_share: float = 1.0

    @property
    def question(self) -> str:
        named = " or ".join(self.signal.shown(state) for state in self.states)
        share = "" if self.least_share >= 1 else f" for {100 * self.least_share:g} % of the time"
        return f"{self.signal.name} is {named}{share}{self.window}"

    def judge(self, evidence: Evidence) -> Verdict:
        series = self.signal.series(evidence)
        seen = self.window.of(series) if series is not None else None
        if seen is None or not seen.time_s.size:
            return open_question(self.question, nothing_of(self.signal, self.window))
        # frames stand for time: they are sent in equal intervals
        inside = np.isin(seen.values, self.states)
        share = float(inside.mean())
        found = f"{100 * share:.1f} % of {inside.size} frames"
        if share >= self.least_share:
            return passed(self.question, found)
        first = int(np.argmin(inside))
        return failed(
            self.question,
            f"{found}; {self.signal.shown(float(seen.values[first]))} at {seen.time_s[first]:.2f} s",
        )


@dataclass(frozen=True, slots=True)
class Reached:
    """A condition becomes true within the window, and then stays true for at least `for_s` [s]."""

    condition: Condition
    window: Window
    for_s: float = 0.0

    @property
    def question(self) -> str:
        lasting = f" for {1e3 * self.for_s:g} ms" if self.for_s else ""
        return f"{self.condition}{lasting}{self.window}"

    def judge(self, evidence: Evidence) -> Verdict:
        series = self.condition.series(evidence)
        seen = self.window.of(series) if series is not None else None
        if seen is None or not seen.time_s.size:
            return open_question(self.question, nothing_of(self.condition.signal, self.window))
        at_s = begins(seen, self.condition.holds(seen.values), self.for_s)
        if at_s.size:
            return passed(self.question, f"at {at_s[0]:.2f} s")
        return failed(self.question, f"never; {_range_of(self.condition.signal, seen)}")


def _range_of(signal: AnySignal, seen: Series) -> str:
    known = seen.values[~np.isnan(seen.values)]
    if not known.size:
        return f"{signal.name} was never available"
    return f"{signal.name} was {signal.shown(float(known.min()))} to {signal.shown(float(known.max()))}"


def begins(series: Series, holds: NDArray[np.bool_], for_s: float = 0.0) -> NDArray[np.float64]:
    """The times [s] at which a condition becomes true and then stays true for at least `for_s` [s]."""
    # the false ends make edges of a condition that holds in the first or the last sample
    edges = np.diff(np.concatenate(([False], holds, [False])).astype(np.int8))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    # from first to last sample, not to the one after: only what was seen to hold counts here
    lasts = series.time_s[stops] - series.time_s[starts] >= for_s - SLACK_S
    return series.time_s[starts[lasts]]


@dataclass(frozen=True, slots=True)
class Response:
    """Each time `cause` becomes true, `effect` is true within a time: the response to a step or to an event."""

    cause: Condition
    effect: Condition
    within_s: float
    window: Window = Window()

    @property
    def question(self) -> str:
        return f"{self.effect} within {1e3 * self.within_s:g} ms of {self.cause}{self.window}"

    def judge(self, evidence: Evidence) -> Verdict:
        causes, effects = self.cause.series(evidence), self.effect.series(evidence)
        for condition, series in ((self.cause, causes), (self.effect, effects)):
            if series is None:
                return open_question(self.question, nothing_of(condition.signal, Window()))
        # for mypy; the loop above returned where one is None
        assert causes is not None
        assert effects is not None
        came_s = begins(causes, self.cause.holds(causes.values))
        came_s = came_s[(came_s >= self.window.from_s) & (came_s <= self.window.to_s)]
        if not came_s.size:
            return open_question(self.question, f"{self.cause} never came{self.window}")
        delays = response_delays(came_s, effects, self.effect.holds(effects.values))
        worst = int(np.argmax(delays))
        # judged by the worst case: one late response fails the expectation
        times = f"{came_s.size} times" if came_s.size > 1 else "once"
        if delays[worst] <= self.within_s + ROUNDING_S:
            return passed(self.question, f"{times}, after {1e3 * delays[worst]:.1f} ms at most")
        if math.isinf(delays[worst]):
            return failed(self.question, f"no answer to {self.cause} at {came_s[worst]:.2f} s")
        return failed(self.question, f"after {1e3 * delays[worst]:.1f} ms at {came_s[worst]:.2f} s")


def response_delays(
    came_s: NDArray[np.float64], effects: Series, holds: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """From each cause to the first sample at or after it at which the effect holds [s]; inf if none."""
    # an effect that held before its cause answers at its next sample: a state needs no new edge
    answers_s = effects.time_s[holds]
    index = np.searchsorted(answers_s, came_s, side="left")
    return np.where(index < answers_s.size, np.append(answers_s, np.inf)[index] - came_s, np.inf)


@dataclass(frozen=True, slots=True)
class Reaction:
    """The ECU echoes each sample of the machine within a time, for a share of the samples."""

    within_s: float
    share: float = 1.0

    @property
    def question(self) -> str:
        share = "every sample" if self.share >= 1 else f"{100 * self.share:g} % of the samples"
        return f"{share} echoed within {1e3 * self.within_s:g} ms"

    def judge(self, evidence: Evidence) -> Verdict:
        samples, answers = evidence.messages.get("Articulation"), evidence.messages.get("EcuStatus")
        if samples is None or answers is None:
            return open_question(self.question, "no Articulation or no EcuStatus on the bus")
        _, took_ns = reactions(
            samples.time_s, samples.signals["SampleSequence"], answers.time_s, answers.signals["EchoSequence"]
        )
        if not took_ns.size:
            return open_question(self.question, "no sample was echoed")
        # in whole nanoseconds: 20 ms as a float is not exactly 20 000 000 ns
        within = float(np.mean(took_ns <= round(self.within_s * 1e9)))
        found = f"{100 * within:.1f} % of {took_ns.size}, slowest {took_ns.max() * 1e-6:.1f} ms"
        return passed(self.question, found) if within >= self.share else failed(self.question, found)


def judge_all(expectations: Sequence[Expectation], evidence: Evidence) -> tuple[Verdict, ...]:
    """The verdicts in the order of the expectations."""
    return tuple(expectation.judge(evidence) for expectation in expectations)


__all__ = [
    "Expectation", "InBounds", "InStates", "NoLiftOff", "NoRollOver", "Reached", "Reaction",
    "Response", "Source", "Window", "begins", "judge_all", "response_delays",
]  # fmt: skip
