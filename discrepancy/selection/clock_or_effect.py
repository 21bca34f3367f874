"""A clock that seems wrong, or an effect of the library?

A strong effect that the baseline lacks may look like stamps of another clock: on a bank the roll angle follows the heading, and the
prediction without the bank, shifted by some seconds, follows it too. The clock is blamed only where no effect explains the channel
better at its own stamps.
"""

import numpy as np

from discrepancy.checks.channel_checks import AnotherClock
from discrepancy.estimation.fit import WindowStates, differences
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect
from discrepancy.selection.screen import Columns, sensitivities
from discrepancy.signals.recording import Array


def an_effect_explains_more(problem: Problem, complaint: AnotherClock) -> bool:
    """Whether an effect, with the size that fits the channel best, leaves less of the channel than the shift in time does.

    One simulation per parameter and trial step of the library; the screen uses them again.
    """
    start = problem.start()
    base = problem.predict(start)
    owner = np.array([w.recording for w in problem.windows])[problem.row_window]
    rows = (owner == complaint.recording) & (problem.row_channel == problem.channels.index(complaint.signal))
    local = differences(problem, start, base, problem.local_names)
    states = WindowStates(local[rows], problem.row_window[rows], np.ones(np.count_nonzero(rows), bool))
    measured, predicted = states.off(problem.measured[rows]), states.off(base[rows])
    with np.errstate(all="ignore"):  # a trial step may diverge
        tried = sensitivities(problem, start, base, problem.model.effects)
    return any(
        _left(columns, step, measured, predicted, states.off(raw[rows])) < complaint.left
        for columns in tried
        for step, raw in enumerate(columns.raw)
        if np.isfinite(raw[rows]).all()
    )


def _left(columns: Columns, step: int, measured: Array, predicted: Array, changed: Array) -> float:
    """Share of the channel's variance that prediction and effect leave; all of it if the effect's size is out of its bounds.

    As for the shift, the size of the prediction and a zero point are free.
    """
    A = np.column_stack((predicted, changed))
    A, y = A - A.mean(axis=0), measured - measured.mean()
    whole = float(y @ y)
    if whole == 0.0:
        return 1.0
    size = np.linalg.lstsq(A, y, rcond=None)[0]
    if not _within_bounds(columns.effect, size[1:] * columns.changes[step]):
        return 1.0
    rest = y - A @ size
    return float(rest @ rest) / whole


def _within_bounds(effect: Effect, changes: Array) -> bool:
    own = effect.amplitude_parameters
    return all(p.lower <= p.value + c <= p.upper for p, c in zip(own, changes, strict=True))
