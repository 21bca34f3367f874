"""Is the model's step fine enough? What half of it changes in the predictions is an error of the integration, and may be taken for an effect."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from discrepancy import gates
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem
from discrepancy.model.failure import BadModel
from discrepancy.selection.screen import Projector
from discrepancy.signals.quantities import quantity

OTHER_MODEL = 0.3  # of a channel's movement; a change as large is none of integration, but of a model that counts in steps


@dataclass(frozen=True, slots=True)
class HalfStep:
    """What half of the step changes."""

    evidence: float  # squared whitened change that nuisances and initial states cannot do
    channel: str  # that changes most, of its movement
    share: float  # of the movement of that channel
    # of the fitted parameters in infinitely small steps, by Richardson's extrapolation
    shifts: Mapping[str, float]

    @property
    def of_integration(self) -> bool:
        """Whether the change can be an error of the integration."""
        return self.share < OTHER_MODEL

    def said(self, step_s: float) -> list[str]:
        """A sentence where the change would be seen."""
        if self.evidence <= gates.HALF_STEP.threshold:
            return []
        step = quantity(step_s, "s")
        if not self.of_integration:
            return [
                f"with half of the model's step of {step} {self.channel} changes by {self.share:.0%} of its movement: does `simulate` use `window.step_s`?"
            ]
        return [
            f"the model's step of {step} is coarse: with half of it the predictions change by evidence {self.evidence:.0f}, most in {self.channel}"
        ]


def at_half_step(problem: Problem, noise: Noise, fitted: Fit) -> HalfStep | None:
    """What half of the step changes at the fitted values; None for expensive models, and for those that cannot be halved."""
    if problem.costs.costly:
        return None
    try:
        finer = problem.again(finer=2)
        after = finer.predict(fitted.values)
    except (BadModel, ValueError):
        return None
    if after.size != problem.measured.size:
        return None
    change = after - problem.predict(fitted.values)
    white, projector = noise.whiten(change), Projector(problem, noise, fitted)
    shares = {}
    for i, name in enumerate(problem.channels):
        own = problem.row_channel == i
        shares[name] = float(np.std(change[own]) / max(np.std(problem.measured[own]), 1e-300))
    channel = max(shares, key=lambda name: shares[name])
    # of an integration of first order, half of the step removes half of the error
    shifts = -2.0 * fitted.covariance @ (fitted.columns.T @ projector.states.off(white))
    return HalfStep(
        evidence=float(np.sum(projector.off(white[:, None]) ** 2)),
        channel=channel,
        share=shares[channel],
        shifts=dict(zip(fitted.names, shifts.tolist(), strict=True)),
    )
