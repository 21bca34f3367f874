"""How many simulations a fit may spend, and what a search leaves out where simulations are expensive.

One frozen object for each question: `Effort` goes with a call of `fit`, `Costs` belongs to a model. Models whose simulations are cheap
(`Model.jacobian_reach` of 0) are never spared anything.
"""

from dataclasses import dataclass
from typing import Final

LEAST_GAIN: Final = 0.02  # share of an effect's reduction in SSE to which the fit without the effect is known
ROUGH_GAIN: Final = 1e-4  # reduction in SSE per row that is worth a step while the noise is not known yet
BEHIND: Final = 0.25  # share of the largest reduction, below which a candidate waits for the next round
REACH: Final = 0.5  # share of the threshold, below which a begun fit is not brought to its end


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """What one fit may spend."""

    iterations: int = 8  # Gauss-Newton steps at most
    cached: bool = False  # Jacobian columns of other points serve while steps keep what they promise
    chord: bool = False  # cached columns are never computed anew, whatever the steps keep
    least_reduction: float = 0.0  # in SSE; a step that promises less is not taken


FULL: Final = Effort()
BRIEF: Final = Effort(iterations=4)
CACHED: Final = Effort(cached=True)
FIRST_STEPS: Final = Effort(iterations=2, cached=True)
TRAINING: Final = Effort(iterations=4, cached=True)  # of a fold of the cross-validation
AS_IT_IS: Final = Effort(iterations=0)  # linearised where it stands


@dataclass(frozen=True, slots=True)
class Costs:
    """What is spared for one model."""

    costly: bool  # whether simulations of this model are expensive

    def least_reduction(self, expected: float) -> float:
        """Reduction in SSE that is not worth a step of the fit without an effect that reduces it by `expected`."""
        return LEAST_GAIN * expected if self.costly else 0.0

    def rough_reduction(self, rows: int) -> float:
        """The same of a fit under noise that is estimated anew afterwards."""
        return ROUGH_GAIN * rows if self.costly else 0.0

    def worth_starting(self, largest: float, clear: float) -> float:
        """Reduction that a candidate has to promise to be fitted now, where the best one promises `largest`."""
        return BEHIND * largest if self.costly and largest > clear else float("-inf")

    def worth_finishing(self, threshold: float) -> float:
        """Reduction that first steps must have brought for the fit to be finished."""
        return REACH * threshold if self.costly else float("-inf")
