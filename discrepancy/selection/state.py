"""The settings of a search and its state: plain data, for the modules of the search."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from discrepancy import gates
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem, Values, Windows
from discrepancy.estimation.set_aside import NOTHING, SetAside
from discrepancy.model.description import Effect
from discrepancy.selection.screen import Columns, Score

Progress = Callable[[str], None]


def never() -> bool:
    """The search has all the time it needs."""
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Thresholds of a search, from the table of gates, and limits of its cost."""

    alpha: float = gates.FALSE_ALARM.threshold  # probability of a false finding in a search
    held_out: float = gates.HELD_OUT_REDUCTION.threshold  # smallest SSE reduction on held-out rows
    confirmed: float = gates.HELD_OUT_SHARE.threshold  # its smallest share of the reduction on all rows
    same: float = (
        6.0  # difference in SSE below which two fits of one effect are equally good: a likelihood ratio of 20
    )
    rival: float = gates.SAME_LIKELIHOOD.threshold  # the same of two effects, of which one is to be excluded
    gap_closed: float = gates.GAP_CLOSED.threshold
    shortlist: int = 6  # effects that are fitted in one round
    most_effects: int = 6  # accepted effects after which a search ends
    most_simulations: int = 3000  # of a costly model, after which a search ends
    folds: int = 2  # of the held-out test
    open_ended: bool = True  # whether an equation outside the library is searched
    # Two helps for difficult recordings, means and intervals. They are off because each has let in a wrong name that the plain search refuses:
    # play in a steering linkage became a lag of its servo, and a leak of another size in every minute passed for one of a constant size.
    average: bool = False  # samples that come faster than the model moves become means (ADR 27)
    # what nothing explains and is left out of a second search (ADR 29): single readings, or intervals of time too
    set_aside: Literal["nothing", "outliers", "intervals"] = "outliers"
    over: Callable[[], bool] = (
        never  # whether the time for the search is over: it ends after its current round
    )

    def least_held_out(self, reduction: float) -> float:
        """Smallest SSE reduction on held-out rows, where all rows give `reduction`."""
        # A reduction g has the standard deviation of a non-central chi-square, about 2 sqrt(g); so much may be missing by chance.
        return max(self.held_out, self.confirmed * reduction - 2.0 * math.sqrt(max(reduction, 0.0)))


@dataclass(frozen=True, slots=True)
class CandidateFit:
    """A fit with one effect more than the state, and the results of its tests."""

    effect: str
    fit: Fit
    sse_reduction: float  # on all rows, over the variance inflation
    raw_sse_reduction: float  # the same, not divided
    threshold: float  # of `sse_reduction`
    held_out_sse_reduction: float | None = (
        None  # summed over folds; None where `sse_reduction` is below the threshold
    )
    variance_inflation: float = 1.0
    size: float = np.inf  # lower 95 % limit of the largest amplitude parameter, in typical changes
    explained: float = 1.0  # largest share of a channel's squared held-out error that the effect removes
    reference: "State | None" = (
        None  # the state without the effect, where its noise differs from that of the search
    )

    @property
    def margin(self) -> float:
        """Raw reduction minus threshold, by which accepted candidates are compared."""
        # Raw, because the variance inflation differs between effects: it is needed to accept one, not to rank two that fit the same rows.
        return self.raw_sse_reduction - self.threshold

    @property
    def passes(self) -> bool:
        """Whether the reduction in SSE is above the threshold."""
        return self.sse_reduction > self.threshold

    def accepted(self, settings: Settings) -> bool:
        """Whether held-out data confirm the reduction."""
        confirmed = self.held_out_sse_reduction
        return confirmed is not None and confirmed > settings.least_held_out(self.sse_reduction)

    def negligible(self, problem: Problem) -> bool:
        """Whether the effect is too small to matter, however significant it is."""
        return self.size < problem.model.negligible or self.explained < problem.model.least_explained


@dataclass(frozen=True, slots=True)
class State:
    """The state of a search with some effects accepted."""

    noise: Noise
    fit: Fit
    accepted: tuple[str, ...]
    scores: tuple[Score, ...]  # of all other effects, best first
    trials: tuple[CandidateFit, ...] = ()
    columns: tuple[Columns, ...] = field(default=(), repr=False)
    temporary: tuple[tuple[Score, Windows], ...] = ()  # effects that may act in one interval only, best first
    temporary_basis: tuple[Noise, Fit] | None = None  # noise and fit under which those were scored
    at_prior: Values | None = (
        None  # values with nuisances at their priors, where one was in conflict with its prior
    )
    aside: SetAside = NOTHING  # what nothing explains and the noise leaves out


def free_names(problem: Problem, effects: Sequence[str]) -> tuple[str, ...]:
    """Shared parameters fitted with these effects on."""
    return problem.nuisance_names + tuple(n for name in effects for n in problem.model.effect(name).names)


def switched_off(effect: Effect) -> dict[str, float]:
    """Parameter values with which an effect is off."""
    return {p.name: p.value for p in effect.parameters}
