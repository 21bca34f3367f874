"""How strict a search is, what it tries, and where it stands."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from discrepancy import gates
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem, Values
from discrepancy.model.description import Effect
from discrepancy.selection.screen import Columns, Score

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Thresholds of a search, from the table of gates, and the limits of what it may cost."""

    alpha: float = gates.FALSE_ALARM.threshold  # chance of a false finding in a search
    held_out: float = gates.HELD_OUT_REDUCTION.threshold  # least reduction in SSE on data not fitted
    confirmed: float = (
        gates.HELD_OUT_SHARE.threshold
    )  # and its least share of the reduction on fitted data, but for chance
    same: float = gates.SAME_LIKELIHOOD.threshold  # difference in SSE that cannot be told apart
    gap_closed: float = gates.GAP_CLOSED.threshold
    shortlist: int = 6  # effects that are fitted in one round
    most_effects: int = 6  # accepted effects after which a search ends
    most_simulations: int = 3000  # of a costly model, after which a search ends
    folds: int = 2  # of the held-out test
    open_ended: bool = True  # whether an equation outside the library is searched

    def least_held_out(self, reduction: float) -> float:
        """Least reduction in SSE on held-out rows where all rows give `reduction`.

        The standard deviation of a reduction g is that of a non-central chi-square, 2 sqrt(g), and that much may be chance.
        """
        return max(self.held_out, self.confirmed * reduction - 2.0 * math.sqrt(max(reduction, 0.0)))


@dataclass(frozen=True, slots=True)
class CandidateFit:
    """One effect added to the nuisances and accepted effects: fitted, tested, confirmed or not."""

    effect: str
    fit: Fit
    sse_reduction: float  # all data, over the variance inflation
    raw_sse_reduction: float  # the same, not divided
    threshold: float  # of the reduction
    held_out_sse_reduction: float | None = (
        None  # summed over folds; None where the reduction is below the threshold
    )
    variance_inflation: float = 1.0
    size: float = np.inf  # least size of the largest amplitude parameter, 95 %, in typical changes
    explained: float = 1.0  # largest share of a channel's squared errors that the effect takes away, held out
    reference: "State | None" = None  # the fit without it, where its noise is not that of the search

    @property
    def margin(self) -> float:
        """Raw reduction beyond the threshold: which effect explains best, once each is sure to explain something."""
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
        """Whether it is too small to matter, however significant."""
        return self.size < problem.model.negligible or self.explained < problem.model.least_explained


@dataclass(frozen=True, slots=True)
class State:
    """Where a search stands with some effects accepted."""

    noise: Noise
    fit: Fit
    accepted: tuple[str, ...]
    scores: tuple[Score, ...]  # of all other effects, best first
    trials: tuple[CandidateFit, ...] = ()
    columns: tuple[Columns, ...] = field(default=(), repr=False)
    temporary: tuple[tuple[Score, range], ...] = ()  # effects that may act in one interval only, best first
    temporary_basis: tuple[Noise, Fit] | None = None  # noise and fit by which those scored
    at_prior: Values | None = (
        None  # the fit with nuisances back at their priors, where one was in conflict with its own
    )


def free_names(problem: Problem, effects: Sequence[str]) -> tuple[str, ...]:
    """Shared parameters fitted with these effects on."""
    return problem.nuisance_names + tuple(n for name in effects for n in problem.model.effect(name).names)


def switched_off(effect: Effect) -> dict[str, float]:
    """Values of an effect's parameters with which it does nothing."""
    return {p.name: p.value for p in effect.parameters}
