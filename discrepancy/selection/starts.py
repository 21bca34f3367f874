"""Starting points of fits with one more effect: at the size that its score expects and at its trial steps, other parameters moved along.

Several starts, because effects such as friction or a lag have more than one local minimum.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from discrepancy import gates
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem, Values, Windows
from discrepancy.model.description import Effect
from discrepancy.selection.screen import Columns, Projector, Score

CLOSER: Final = 0.3  # share of its size that a start keeps in one step back
STEPS: Final = 4  # at most: back to a hundredth, on to a hundred times
CLEAR: Final = gates.CLEAR.threshold


@dataclass(frozen=True, slots=True)
class Start:
    """A starting point of a fit."""

    values: Values
    sse_reduction: float  # at this point, with initial states free


class Starts:
    """Starting points beside one fit; columns: of all candidates at that fit; at_prior: as in State."""

    def __init__(
        self,
        problem: Problem,
        noise: Noise,
        fitted: Fit,
        columns: Sequence[Columns],
        at_prior: Values | None = None,
    ) -> None:
        self._problem, self._noise, self._fit, self._at_prior = problem, noise, fitted, at_prior
        self._columns = {c.effect.name: c for c in columns}
        self._states = Projector(problem, noise, fitted).states

    def of(self, found: Score, windows: Windows | None) -> list[Start]:
        """Starting points, best first: those better than the fit without the effect, or the best one if none is.

        windows: windows in which the effect acts; None: all.
        """
        effect = self._problem.model.effect(found.effect)

        def start_at(point: Values) -> Start:
            acting = point if windows is None else point.active_in(effect.amplitude_parameters, windows)
            return sized(effect, acting, self._sse_reduction)

        points = []
        for point in starts(self._fit.values, effect, found):
            alone, along = start_at(point), start_at(self._along(found, point, windows))
            points.append(max(alone, along, key=lambda start: start.sse_reduction))
        if self._at_prior is not None:
            points.append(start_at(starts(self._at_prior, effect, found)[0]))
        points.sort(key=lambda start: -start.sse_reduction)
        if effect.shapes_at_typical and not any(p.trial_steps for p in effect.amplitude_parameters):
            # the size at which it was scored: a score is linear, and by shapes an effect is not
            scored = start_at(self._fit.values.with_shared(_as_scored(effect, found)))
            if scored.sse_reduction > points[0].sse_reduction + CLEAR:
                points.insert(0, scored)
        return [points[0], *(start for start in points[1:] if start.sse_reduction > 0.0)]

    def _along(self, found: Score, point: Values, windows: Windows | None) -> Values:
        """The point with all other fitted parameters moved, to first order, to their best values beside the effect at its size there."""
        problem, fitted, columns = self._problem, self._fit, self._columns[found.effect]
        sizes = np.array([point.shared[p.name] - p.value for p in columns.effect.amplitude_parameters])
        nearest = int(np.argmin([np.sum((sizes - changes) ** 2) for changes in columns.changes]))
        raw = columns.raw[nearest] @ (sizes / columns.changes[nearest])
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

    def _sse_reduction(self, point: Values) -> float:
        """Reduction of the SSE at a point, against the fit without the effect."""
        problem = self._problem
        left = self._states.off(self._noise.whiten(problem.measured - problem.predict(point))[:, None])
        known = [problem.model.parameter(name) for name in self._fit.names]
        prior = sum(((point.shared[p.name] - p.value) / p.prior_sd) ** 2 for p in known if p.prior_sd)
        return self._fit.sse - float(np.sum(left**2)) - prior


def starts(at: Values, effect: Effect, found: Score) -> list[Values]:
    """The expected change, within bounds, and the best trial step, which may be in another minimum; shapes at their typical values."""
    shapes, own = effect.shapes_at_typical, effect.amplitude_parameters
    expected = {
        p.name: float(np.clip(p.value + change, p.lower, p.upper))
        for p, change in zip(own, found.change, strict=True)
    }
    points = [at.with_shared({**shapes, **expected})]
    if any(p.trial_steps for p in own):
        points.append(at.with_shared(_as_scored(effect, found)))
    return points


def _as_scored(effect: Effect, found: Score) -> dict[str, float]:
    """The values at which an effect was simulated for its score, of its best trial step."""
    step = {
        p.name: p.trial_values[min(found.nearest, len(p.trial_values) - 1)]
        for p in effect.amplitude_parameters
    }
    return {**effect.shapes_at_typical, **step}


def sized(effect: Effect, point: Values, sse_reduction: Callable[[Values], float]) -> Start:
    """A start at the point, at a larger effect that explains clearly more, or at a smaller one that explains anything.

    The size of the point comes from a score, which is linear. Where an effect is strong it can be ten times too large or too small, and no fit
    returns from there.
    """
    start = Start(point, sse_reduction(point))
    if any(p.discrete for p in effect.amplitude_parameters):
        return start  # half a wrong sign is no start for a wrong sign
    if start.sse_reduction > CLEAR:
        return moved_on(effect, start, sse_reduction)
    return start if start.sse_reduction > 0.0 else moved_back(effect, start, sse_reduction)


def moved_on(effect: Effect, start: Start, sse_reduction: Callable[[Values], float]) -> Start:
    """The start, or one of a larger effect as long as that explains more."""
    for _ in range(STEPS):
        farther = _scaled(effect, start.values, 1.0 / CLOSER)
        reduction = sse_reduction(farther)
        if reduction <= start.sse_reduction:
            break
        start = Start(farther, reduction)
    return start


def moved_back(effect: Effect, start: Start, sse_reduction: Callable[[Values], float]) -> Start:
    """The first start on the way back to the baseline that explains anything; the given one if none does."""
    near = start.values
    for _ in range(STEPS):
        near = _scaled(effect, near, CLOSER)
        reduction = sse_reduction(near)
        if reduction > 0.0:
            return Start(near, reduction)
    return start


def _scaled(effect: Effect, point: Values, factor: float) -> Values:
    """The point with an effect of so many times the size, within bounds."""
    return point.with_shared(
        {
            p.name: float(np.clip(p.value + factor * (point.shared[p.name] - p.value), p.lower, p.upper))
            for p in effect.amplitude_parameters
        }
    )
