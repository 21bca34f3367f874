"""How far two explanations of the present recordings would disagree on a further one.

One explanation predicts the recording, and the other is fitted to that prediction. What the present recordings say of its parameters, with
the priors, is its prior there. The SSE that is then left is the expected difference: twice the logarithm of the likelihood ratio by which the
recording would distinguish them (T-optimality, Atkinson and Fedorov 1975). The fit is linearised at the present estimate.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from discrepancy.estimation.effort import AS_IT_IS
from discrepancy.estimation.fit import Fit, fit, initial_uncertainty
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.normal_equations import inverse
from discrepancy.estimation.problem import Problem, Values
from discrepancy.model.description import Manoeuvre, Model
from discrepancy.signals.recording import Recording, Signal


class Prospect:
    """A recording that could be made, beside the present ones and their noise. Its outputs are stamps; their values are not used."""

    def __init__(
        self,
        present: Problem,
        noise: Noise,
        recording: Recording,
        *,
        model: Model | None = None,
        initial: Mapping[str, float] | None = None,
    ) -> None:
        """model: for that recording, where it has to know it; initial: initial states by name. Raises Unusable."""
        model = present.model if model is None else model
        # a model that chooses segments needs no initial states; any other is simulated from those that are known
        self._problem = Problem(
            model if model.segments is not None else replace(model, window_s=None), [recording]
        )
        known = initial or {}
        self._local = {
            p.name: np.full(len(self._problem.windows), known.get(p.name, p.value))
            for p in model.nuisances
            if p.scope == "window"
        }
        self._noise = noise.on(self._problem)

    def difference(self, one: Fit, other: Fit) -> float:
        """The expected difference in SSE between two explanations, each fitted to the present recordings; the smaller of both directions."""
        return min(self.left_over(one, other), self.left_over(other, one))

    def left_over(self, true: Fit, assumed: Fit) -> float:
        """The SSE that is left when `assumed` is fitted to what `true` predicts."""
        staged = self._problem.measuring(self._values(true))
        at = self._values(assumed)
        effort = replace(AS_IT_IS, cached=True)
        noise = self._noise
        if staged.initial_uncertainty_names:
            unsure = initial_uncertainty(staged, at, staged.predict(at), cached=True)
            noise = noise.having(staged, unsure)
        point = fit(staged, noise, assumed.names, at, effort=effort)
        towards = point.columns.T @ point.residual
        moved = inverse(point.columns.T @ point.columns + assumed.information) @ towards
        return max(float(point.residual @ point.residual - towards @ moved), 0.0)

    def _values(self, fitted: Fit) -> Values:
        values = Values(fitted.values.shared, self._local)
        return self._problem.warmed_up(values, values)


def manoeuvre_recording(problem: Problem, manoeuvre: Manoeuvre) -> Recording:
    """A manoeuvre of a model as a recording, with stamps as dense as those recorded; output values are placeholders."""
    signals: dict[str, Signal] = dict(manoeuvre.inputs)
    for block in problem.blocks:
        step = float(np.median(np.diff(block.time_s)))
        stamps = np.arange(0.0, manoeuvre.duration_s, step)
        for name in block.channels:
            signals.setdefault(name, Signal(stamps, stamps.copy(), problem.model.outputs[name]))
    return Recording(manoeuvre.name, signals, problem.windows[0].constants)
