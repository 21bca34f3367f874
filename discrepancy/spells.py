"""Effects that act for a while only: the run of windows in which one scores best.

A scan over all runs of windows of a recording: sums over windows give each of them at once. What a gain must exceed grows with the
number of runs that were searched (Bonferroni).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.model import Effect
from discrepancy.noise import Noise
from discrepancy.problem import Problem, Values
from discrepancy.recording import Array
from discrepancy.screen import FEWEST_STRETCHES, Projector, active, penalty

FEWEST_WINDOWS = 3  # of a spell, and outside of it


@dataclass(frozen=True, slots=True)
class Spell:
    """Windows in which an effect acts, the statistic of the score there, and its size in units of the change that was tried."""

    windows: range
    statistic: float
    size: float


def runs(problem: Problem) -> list[range]:
    """All runs of windows of one recording, with enough windows in and outside; none for models too costly to try them."""
    count = len(problem.windows)
    if problem.model.slopes_hold > 0.0 or count < FEWEST_STRETCHES:
        return []
    owner = [w.recording for w in problem.windows]
    return [
        range(first, stop)
        for first in range(count)
        for stop in range(first + FEWEST_WINDOWS, count + 1)
        if owner[first] == owner[stop - 1] and stop - first <= count - FEWEST_WINDOWS
    ]


def price(problem: Problem, effect: Effect, values: Values, alpha: float) -> float:
    """What the gain of an effect must exceed: its penalty, and that for the choice of the windows in which it acts."""
    plain = penalty(effect.size, len(problem.model.effects), alpha)
    return plain + (searched(runs(problem)) if spell_of(effect, values) else 0.0)


def searched(among: Sequence[range]) -> float:
    """Penalty for the choice of one of so many runs of windows."""
    return 2.0 * float(np.log(len(among)))


def spell_of(effect: Effect, values: Values) -> range | None:
    """Windows in which an effect acts; None if in all."""
    return next((values.spells[name] for name in active(effect) if name in values.spells), None)


def best_spell(
    noise: Noise, projector: Projector, residual: Array, raw: Array, among: Sequence[range]
) -> Spell | None:
    """The run in which one column of raw sensitivities (N,) scores best, nuisances and initial states projected out."""
    if not among:
        return None
    white = projector.states.off(noise.whiten(raw))
    columns, inverse = projector.nuisances
    count = int(noise.row_window.max()) + 1

    def summed(rows: Array) -> Array:
        return np.concatenate([[0.0], np.cumsum(np.bincount(noise.row_window, rows, count))])

    own, seen = summed(white**2), summed(white * residual)
    shared = np.array([summed(white * column) for column in columns.T]).reshape(-1, count + 1).T
    pull = inverse @ (columns.T @ residual)
    first, stop = np.array([r.start for r in among]), np.array([r.stop for r in among])
    cross = shared[stop] - shared[first]
    power = own[stop] - own[first] - np.einsum("ri,ij,rj->r", cross, inverse, cross)
    score = seen[stop] - seen[first] - cross @ pull
    statistic = np.where(power > 1e-6 * max(own[-1], 1e-300), score**2 / np.maximum(power, 1e-300), 0.0)
    best = int(np.argmax(statistic))
    if statistic[best] == 0.0:
        return None
    return Spell(among[best], float(statistic[best]), float(score[best] / power[best]))
