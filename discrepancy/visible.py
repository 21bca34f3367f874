"""Whether recordings like these would show an effect of typical size, where nuisances can do nearly the same.

The screen takes nuisances for straight lines. A finite effect in a valley with one of them leaves a curve beside the line: the screen
counts it as visible, but the nuisance follows it when it is fitted (softer tyres of both axles and less inflation).
"""

from collections.abc import Sequence

import numpy as np

from discrepancy.fit import fit
from discrepancy.model import Effect, Parameter
from discrepancy.problem import Problem
from discrepancy.recording import Array
from discrepancy.screen import FEW, Score, changes_at, switches
from discrepancy.state import State

NEARLY = 0.5  # share of an effect that nuisances can do, from which on it is asked what they leave of it in a refit
STEPS = 6


def in_a_valley(effect: Effect, score: Score) -> bool:
    """Whether it is worth a refit: faults of sensors are straight lines themselves."""
    return effect.kind == "physics" and score.absorbed > NEARLY and len(switches(effect)) <= FEW


def left_by_refit(problem: Problem, state: State, effect: Effect, score: Score) -> float:
    """Noncentrality of typical changes in their least visible combination: what a fit without them loses where they are, without noise.

    Priors count beyond what they cost already; over the inflation of the score.
    """
    fitted, own = state.fit, switches(effect)
    changes = _feasible(own, least_visible(effect, score))
    shapes = {p.name: p.value + p.typical for p in effect.parameters if p.shape}
    there = {p.name: float(p.value + c) for p, c in zip(own, changes, strict=True)}
    supposed = problem.read_as(fitted.values.with_shared({**shapes, **there}))
    without = fit(
        supposed, state.noise, fitted.names, fitted.values, iterations=STEPS, rough=True, chord=True
    )
    problem.simulations = supposed.simulations
    lost = max(without.sse - (fitted.sse - fitted.data_sse), 0.0)
    return lost / score.inflation / _size(own, changes) ** 2


def least_visible(effect: Effect, score: Score) -> Array:
    """Changes of its switches, together one typical change, that the projected sensitivities show least."""
    typical = np.array([p.typical for p in switches(effect)])
    scaled = score.direction * (typical / changes_at(effect, score.probe))
    return np.asarray(np.linalg.eigh(scaled.T @ scaled)[1][:, 0] * typical, float)


def _feasible(own: Sequence[Parameter], change: Array) -> Array:
    """The change or its opposite, whichever is larger within the bounds."""
    off = np.array([p.value for p in own])
    low, high = np.array([p.lower for p in own]) - off, np.array([p.upper for p in own]) - off
    return max((np.clip(sign * change, low, high) for sign in (1.0, -1.0)), key=lambda c: _size(own, c))


def _size(own: Sequence[Parameter], change: Array) -> float:
    """In typical changes."""
    return float(np.linalg.norm(change / np.array([p.typical for p in own])))
