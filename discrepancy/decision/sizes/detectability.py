"""Detectability of effects that nuisances nearly imitate: whether recordings like these would show a typical size after a refit.

The screen is linear in the nuisances. A large effect is curved, and the screen counts the curved part as visible. A refitted nuisance
follows the curve as well (softer tyres on both axles imitate low inflation), so that less is visible than the screen says.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from discrepancy import gates
from discrepancy.estimation.effort import Effort
from discrepancy.estimation.fit import fit
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Parameter
from discrepancy.selection.screen import Score, changes_at
from discrepancy.selection.state import State
from discrepancy.signals.recording import Array

# this fit decides a power, not a name, so cached columns are accurate enough: it costs no new Jacobian
WITHOUT: Final = Effort(iterations=6, cached=True, chord=True)


def in_a_valley(effect: Effect, score: Score) -> bool:
    """Whether an effect needs the refit: sensor faults are linear, and profiles have too many directions."""
    return (
        effect.kind == "physics"
        and score.confounded_share > gates.CONFOUNDED.threshold
        and not effect.is_profile
    )


def left_by_refit(problem: Problem, state: State, effect: Effect, score: Score) -> float:
    """Noncentrality of a typical change after a refit, in the least visible combination of the effect's parameters.

    Divided by the variance inflation of the score, as the statistic is.
    """
    # Simulate a noise-free recording that contains the effect, and fit the model without it: the SSE that remains is the noncentrality.
    # The SSE of the priors before the change is subtracted, as it is not caused by the effect.
    fitted, own = state.fit, effect.amplitude_parameters
    changes = _feasible(own, least_visible(effect, score))
    there = {p.name: float(p.value + c) for p, c in zip(own, changes, strict=True)}
    supposed = problem.measuring(fitted.values.with_shared({**effect.shapes_at_typical, **there}))
    without = fit(supposed, state.noise, fitted.names, fitted.values, effort=WITHOUT)
    lost = max(without.sse - (fitted.sse - fitted.data_sse), 0.0)
    return lost / score.variance_inflation / _size(own, changes) ** 2


def least_visible(effect: Effect, score: Score) -> Array:
    """Changes of the amplitude parameters (k,), of the length of one typical change, in the least visible direction."""
    typical = np.array([p.typical for p in effect.amplitude_parameters])
    scaled = score.direction * (typical / changes_at(effect, score.trial_step))
    return np.asarray(np.linalg.eigh(scaled.T @ scaled)[1][:, 0] * typical, float)


def _feasible(own: Sequence[Parameter], change: Array) -> Array:
    """The change or its opposite, whichever is larger within the bounds."""
    off = np.array([p.value for p in own])
    low, high = np.array([p.lower for p in own]) - off, np.array([p.upper for p in own]) - off
    return max((np.clip(sign * change, low, high) for sign in (1.0, -1.0)), key=lambda c: _size(own, c))


def _size(own: Sequence[Parameter], change: Array) -> float:
    """Length of a change, in typical changes."""
    return float(np.linalg.norm(change / np.array([p.typical for p in own])))
