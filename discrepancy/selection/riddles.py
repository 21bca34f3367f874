"""What remains a riddle when a search has ended: outliers and intervals that nothing explains, to be left out of a second search."""

from typing import Final

import numpy as np

from discrepancy import gates
from discrepancy.estimation.effort import AS_IT_IS, BRIEF
from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.noise import Noise, estimate_noise, restored, setting_aside, what_is_aside
from discrepancy.estimation.problem import Problem
from discrepancy.estimation.set_aside import NOTHING, SetAside, lone_readings, same_rows
from discrepancy.selection.state import State
from discrepancy.selection.unexplained import unexplained, unexplained_by_window
from discrepancy.signals.recording import Array

ROUNDS: Final = 6  # of a fit and of rows that nothing explains


def to_set_aside(problem: Problem, state: State, *, with_intervals: bool) -> SetAside:
    """The rows that nothing explains beside what was accepted; every candidate is free in every window, because a temporary effect is no riddle.

    Asked at the end of a search: strong effects are then fitted, while a linear forecast of them leaves errors of its own. Where some effect helps far beyond
    chance and yet was not accepted, the errors are its own. Models whose simulations are expensive are not asked: see `wrong_readings`.

    with_intervals: intervals of time too; else only readings that stand alone.
    """
    helps = (t for t in state.trials if t.effect not in state.accepted and not t.reference)
    if problem.costs.costly or any(
        t.raw_sse_reduction > max(t.threshold, gates.CLEAR.threshold) for t in helps
    ):
        return NOTHING
    found, at, spared = state.noise, state.fit, set[int]()
    # outliers pull a fit towards them, and hide behind the noise that they make large: hence the rounds
    for _ in range(ROUNDS):
        raw = problem.measured - problem.predict(at.values)
        at = fit(problem, found, at.names, at.values, effort=AS_IT_IS)
        by_window = unexplained_by_window(problem, found, at, raw, state.columns)
        known = found.set_aside
        found = setting_aside(problem, *by_window, found, raw, spared, with_intervals=with_intervals)
        if same_rows(known, found.set_aside):
            break
        at = fit(problem, found, at.names, at.values, effort=BRIEF)
    if not found.set_aside:
        return NOTHING
    raw = problem.measured - problem.predict(at.values)
    at = fit(problem, found, at.names, at.values, effort=AS_IT_IS)
    left, used = unexplained(problem, found, at, raw, state.columns)
    return _described(problem, left, used, found, with_intervals=with_intervals)


def wrong_readings(problem: Problem, fitted: Fit) -> SetAside:
    """Single readings of one sensor that are far off; for models whose simulations are expensive, which are searched once.

    Asked before any candidate is known, at the baseline's fit. No machine moves there and back between two samples, and a blow is felt by more
    than one sensor, so no effect is needed to say that such a reading is wrong.
    """
    raw = problem.measured - problem.predict(fitted.values)
    residuals = [raw[block.start : block.stop].reshape(block.shape) for block in problem.blocks]
    rows = [np.zeros(block.shape[0], bool) for block in problem.blocks]
    found = []
    for number, row, reading in lone_readings(problem.blocks, residuals):
        rows[number][row] = True
        found.append(reading)
    if not found:
        return NOTHING
    return SetAside(tuple(rows), tuple(sorted(found, key=lambda s: (s.window, s.start_s))))


def _described(problem: Problem, left: Array, used: float, found: Noise, *, with_intervals: bool) -> SetAside:
    """What a noise sets aside, without what was only predicted from it, and with its times; left: the residual that nothing explains."""
    noise = restored(problem, left, used, found, with_intervals=with_intervals)
    rows = tuple(noise.set_aside)
    return SetAside(rows, tuple(what_is_aside(problem, left, estimate_noise(problem, left, used, noise))))
