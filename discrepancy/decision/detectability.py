"""Whether recordings like these would show an effect of typical size, where nuisances can do nearly the same.

The screen is linear in the nuisances. A finite effect may leave something that is curved, which the screen counts as visible; a
nuisance that is fitted follows the curve (softer tyres on both axles, and less inflation).
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from discrepancy import gates
from discrepancy.estimation.effort import Effort
from discrepancy.estimation.fit import fit
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Parameter
from discrepancy.selection.screen import FEW, Score, changes_at
from discrepancy.selection.state import State
from discrepancy.signals.recording import Array

WITHOUT: Final = Effort(iterations=6, cached=True, chord=True)  # of a fit that only has to come near


def in_a_valley(effect: Effect, score: Score) -> bool:
    """Whether it is worth a refit: faults of sensors are straight lines themselves."""
    return (
        effect.kind == "physics"
        and score.confounded_share > gates.CONFOUNDED.threshold
        and len(effect.amplitude_parameters) <= FEW
    )


def left_by_refit(problem: Problem, state: State, effect: Effect, score: Score) -> float:
    """Noncentrality of typical changes in their least visible combination: what a fit without them loses where they are, without noise.

    Priors count beyond what they cost already; divided by the variance inflation of the score.
    """
    fitted, own = state.fit, effect.amplitude_parameters
    changes = _feasible(own, least_visible(effect, score))
    there = {p.name: float(p.value + c) for p, c in zip(own, changes, strict=True)}
    supposed = problem.measuring(fitted.values.with_shared({**effect.shapes_at_typical, **there}))
    without = fit(supposed, state.noise, fitted.names, fitted.values, effort=WITHOUT)
    lost = max(without.sse - (fitted.sse - fitted.data_sse), 0.0)
    return lost / score.variance_inflation / _size(own, changes) ** 2


def least_visible(effect: Effect, score: Score) -> Array:
    """Changes of its amplitude parameters, together one typical change, that the projected sensitivities show least."""
    typical = np.array([p.typical for p in effect.amplitude_parameters])
    scaled = score.direction * (typical / changes_at(effect, score.trial_step))
    return np.asarray(np.linalg.eigh(scaled.T @ scaled)[1][:, 0] * typical, float)


def _feasible(own: Sequence[Parameter], change: Array) -> Array:
    """The change or its opposite, whichever is larger within the bounds."""
    off = np.array([p.value for p in own])
    low, high = np.array([p.lower for p in own]) - off, np.array([p.upper for p in own]) - off
    return max((np.clip(sign * change, low, high) for sign in (1.0, -1.0)), key=lambda c: _size(own, c))


def _size(own: Sequence[Parameter], change: Array) -> float:
    """In typical changes."""
    return float(np.linalg.norm(change / np.array([p.typical for p in own])))
