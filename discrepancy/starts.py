"""Where refits with one more effect begin: at the size that its score expects and at its probes, with all else moved along."""

from collections.abc import Sequence

import numpy as np

from discrepancy.fit import Fit
from discrepancy.model import Effect
from discrepancy.noise import Noise
from discrepancy.problem import Problem, Values
from discrepancy.screen import Columns, Projector, Score, switches


class Starts:
    """Starts beside one fit, and the gain in SSE there (initial states free); columns: of all candidates at that fit."""

    def __init__(
        self,
        problem: Problem,
        noise: Noise,
        fitted: Fit,
        columns: Sequence[Columns],
        unstrained: Values | None = None,
    ) -> None:
        self._problem, self._noise, self._fit, self._unstrained = problem, noise, fitted, unstrained
        self._columns = {c.effect.name: c for c in columns}
        self._states = Projector(problem, noise, fitted).states

    def of(self, found: Score, windows: range | None) -> list[tuple[Values, float]]:
        """Best first; those that begin worse than without the effect only if all do, and then one. windows: in which the effect acts, all if None."""
        effect = self._problem.model.effect(found.effect)

        def begun(point: Values) -> tuple[Values, float]:
            acting = point if windows is None else point.acting(switches(effect), windows)
            return acting, self._gain(acting)

        points = []
        for point in starts(self._fit.values, effect, found):
            alone, along = begun(point), begun(self._along(found, point, windows))
            points.append(max(alone, along, key=lambda b: b[1]))
        if self._unstrained is not None:
            points.append(begun(starts(self._unstrained, effect, found)[0]))
        points.sort(key=lambda b: -b[1])
        return [points[0], *(b for b in points[1:] if b[1] > 0.0)]

    def _along(self, found: Score, point: Values, windows: range | None) -> Values:
        """The point with what is fitted already where it fits best beside the effect at its size there, as far as sensitivities tell."""
        problem, fitted, columns = self._problem, self._fit, self._columns[found.effect]
        sizes = np.array([point.shared[p.name] - p.value for p in switches(columns.effect)])
        probe = int(np.argmin([np.sum((sizes - changes) ** 2) for changes in columns.changes]))
        raw = columns.raw[probe] @ (sizes / columns.changes[probe])
        if windows is not None:
            raw = np.where(np.isin(problem.row_window, windows), raw, 0.0)
        white = self._states.off(self._noise.whiten(raw[:, None]))[:, 0]
        moved = -fitted.covariance @ (fitted.columns.T @ white)
        known = [problem.model.parameter(name) for name in fitted.names]
        return point.with_shared(
            {
                p.name: float(np.clip(point.shared[p.name] + change, p.lower, p.upper))
                for p, change in zip(known, moved, strict=True)
            }
        )

    def _gain(self, point: Values) -> float:
        problem = self._problem
        left = self._states.off(self._noise.whiten(problem.measured - problem.predict(point))[:, None])
        known = [problem.model.parameter(name) for name in self._fit.names]
        prior = sum(((point.shared[p.name] - p.value) / p.prior_sd) ** 2 for p in known if p.prior_sd)
        return self._fit.sse - float(np.sum(left**2)) - prior


def starts(at: Values, effect: Effect, found: Score) -> list[Values]:
    """The expected change, within bounds, and the best probe, which may lie in another minimum; shapes at their typical value."""
    shapes = {p.name: p.value + p.typical for p in effect.parameters if p.shape}
    expected = {
        p.name: float(np.clip(p.value + change, p.lower, p.upper))
        for p, change in zip(switches(effect), found.change, strict=True)
    }
    points = [at.with_shared({**shapes, **expected})]
    if any(p.probes for p in switches(effect)):
        probe = {p.name: p.tried[min(found.nearest, len(p.tried) - 1)] for p in switches(effect)}
        points.append(at.with_shared({**shapes, **probe}))
    return points
