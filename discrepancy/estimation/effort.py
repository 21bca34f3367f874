"""Limits on the number of simulations: of one fit (`Effort`), and of a search with an expensive model (`Costs`).

Models whose simulations are cheap (`Model.jacobian_reach` of 0) are always fitted completely.
"""

from dataclasses import dataclass
from typing import Final

# An effect's reduction is the difference of two fits. The fit without the effect is exact enough at 2 % of that difference, which is less
# than the spread by chance.
LEAST_GAIN: Final = 0.02
# White rows have an SSE of 1 each, so 1e-4 per row is 0.01 % of it: less than the change when the noise is estimated again.
ROUGH_GAIN: Final = 1e-4
# A candidate that promises less than a quarter of the best waits: once the best is accepted, its score often vanishes with it.
BEHIND: Final = 0.25  # share of the largest reduction
# The first two steps bring most of a reduction; a fit below half of its threshold then does not reach it any more.
REACH: Final = 0.5  # share of the threshold


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """Limits of one fit."""

    iterations: int = 8  # Gauss-Newton steps at most
    cached: bool = (
        False  # use Jacobian columns of other points as long as the steps reduce the SSE as forecast
    )
    chord: bool = False  # never replace cached columns, even if a step falls short of its forecast
    least_reduction: float = 0.0  # of the SSE; a step with a smaller forecast ends the fit


FULL: Final = Effort()
BRIEF: Final = Effort(iterations=4)
CACHED: Final = Effort(cached=True)
FIRST_STEPS: Final = Effort(iterations=2, cached=True)
TRAINING: Final = Effort(iterations=4, cached=True)  # of a fold of the cross-validation
AS_IT_IS: Final = Effort(iterations=0)  # no step: only linearised at the given values


@dataclass(frozen=True, slots=True)
class Costs:
    """Limits of a search with one model."""

    costly: bool  # whether simulations of this model are expensive

    def least_reduction(self, expected: float) -> float:
        """Smallest reduction of the SSE that is worth a step, in the fit without an effect that reduces it by `expected`."""
        return LEAST_GAIN * expected if self.costly else 0.0

    def rough_reduction(self, rows: int) -> float:
        """Smallest reduction of the SSE that is worth a step, in a fit after which the noise is estimated again."""
        return ROUGH_GAIN * rows if self.costly else 0.0

    def worth_starting(self, largest: float, clear: float) -> float:
        """Smallest forecast reduction with which a candidate is fitted in this round; largest: that of the best candidate."""
        return BEHIND * largest if self.costly and largest > clear else float("-inf")

    def worth_finishing(self, threshold: float) -> float:
        """Smallest reduction after the first steps with which a fit is continued."""
        return REACH * threshold if self.costly else float("-inf")
