"""What a search is told, what it tries, and where it stands."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from discrepancy.fit import Fit
from discrepancy.noise import Noise
from discrepancy.problem import Problem, Values
from discrepancy.screen import (
    Columns,
    Score,
)

Progress = Callable[[str], None]
CLEAR = 100.0  # beyond doubt: another round comes, in which it may be tried again
STRAINED = 3.0  # standard deviations of its prior beyond which a nuisance stands in for something else


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How strict to be. alpha: chance of a false finding in a search; held_out: least gain in SSE on data not fitted;
    confirmed: and least share of the gain on fitted data, but for chance; same: likelihood difference (in SSE) that cannot be told apart;
    most_simulations: of a costly model, from which on no further effect is looked for.
    """

    alpha: float = 0.02
    held_out: float = 4.0
    confirmed: float = 0.3
    same: float = 6.0
    gap_closed: float = 0.5
    shortlist: int = 6
    most_effects: int = 6
    most_simulations: int = 3000
    folds: int = 2
    open_ended: bool = True

    def least_held_out(self, gain: float) -> float:
        """What held-out rows have to gain where all rows gain so much: the standard deviation of a gain g, as of a chi-square's that is not

        central, is 2 sqrt(g), and that much may be chance.
        """
        return max(self.held_out, self.confirmed * gain - 2.0 * math.sqrt(max(gain, 0.0)))


@dataclass(frozen=True, slots=True)
class Trial:
    """One effect added to the nuisances and accepted effects: refitted, tested, confirmed or not."""

    effect: str
    fit: Fit
    gain: float  # in SSE, all data, over inflation
    plain: float  # the same not divided
    needed: float
    held_out_gain: float | None = None  # summed over folds; only put to the test if gain > needed
    inflation: float = 1.0
    size: float = np.inf  # what its largest switch surely is, in typical changes
    explained: float = (
        1.0  # share of the squared errors of the channel it helps most that it takes away, held out
    )
    beside: "State | None" = (
        None  # the fit without it, under the noise left beside it, where that is not that of the search
    )

    @property
    def lead(self) -> float:
        """Gain in SSE itself, beyond what is needed: which effect explains best, once it is sure that it explains something."""
        return self.plain - self.needed

    def accepted(self, settings: Settings) -> bool:
        return self.held_out_gain is not None and self.held_out_gain > settings.least_held_out(self.gain)

    def negligible(self, problem: Problem) -> bool:
        """Whether it is too small to matter, however significant."""
        return self.size < problem.model.negligible or self.explained < problem.model.least_explained


@dataclass(frozen=True, slots=True)
class State:
    """Where a search stands: noise, the fit with the accepted effects, the screen of the others, and what was tried.

    passing: effects that may act for a while only, best first; seen_under: the noise and fit by which they were seen; unstrained: the fit with nuisances put back to their priors, where the data had pushed one far from it.
    """

    noise: Noise
    fit: Fit
    accepted: tuple[str, ...]
    scores: tuple[Score, ...]
    trials: tuple[Trial, ...] = ()
    columns: tuple[Columns, ...] = field(default=(), repr=False)
    passing: tuple[tuple[Score, range], ...] = ()
    seen_under: tuple[Noise, Fit] | None = None
    unstrained: Values | None = None


def free_names(problem: Problem, effects: Sequence[str]) -> tuple[str, ...]:
    """Shared parameters fitted with these effects on."""
    return problem.nuisance_names + tuple(n for name in effects for n in problem.model.effect(name).names)
