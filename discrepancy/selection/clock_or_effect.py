"""A clock that seems wrong, or an effect of the library?

A strong effect that the baseline lacks may look like stamps of another clock: on a bank the roll angle follows the heading, and the
prediction without the bank, shifted by some seconds, follows it too. The clock is blamed only where no effect explains the channel
better at its own stamps.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import lsq_linear

from discrepancy.checks.channel_checks import AnotherClock
from discrepancy.estimation.fit import WindowStates, differences
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect
from discrepancy.selection.screen import sensitivities
from discrepancy.signals.recording import Array, Complaint


def still_blamed(problem: Problem, complaints: Sequence[Complaint]) -> list[Complaint]:
    """The complaints, without those on clocks of channels that an effect of the library explains better than the shift does."""
    suspected = [c for c in complaints if isinstance(c, AnotherClock)]
    if not suspected:
        return list(complaints)  # without the cost of trying every effect
    start = problem.start()
    base = problem.predict(start)
    local = differences(problem, start, base, problem.local_names)
    tried = sensitivities(problem, start, base, problem.model.effects)
    owner = np.array([w.recording for w in problem.windows])[problem.row_window]

    def left(complaint: AnotherClock) -> Iterator[float]:
        rows = (owner == complaint.recording) & (
            problem.row_channel == problem.channels.index(complaint.signal)
        )
        states = WindowStates(local[rows], problem.row_window[rows], np.ones(np.count_nonzero(rows), bool))
        measured, predicted = states.off(problem.measured[rows]), states.off(base[rows])
        for columns in tried:
            for raw, change in zip(columns.raw, columns.changes, strict=True):
                yield _left(columns.effect, change, measured, predicted, states.off(raw[rows]))

    cleared = {c for c in suspected if any(share < c.left for share in left(c))}
    return [c for c in complaints if c not in cleared]


def _left(effect: Effect, change: Array, measured: Array, predicted: Array, changed: Array) -> float:
    """Share of the channel's variance (n,) that the prediction and the effect leave, at the size within its bounds that fits best.

    changed: what the trial step `change` of each amplitude parameter (k,) does to the channel (n, k). As for the shift, the size of the
    prediction and a zero point are free.
    """
    A = np.column_stack((predicted, changed))
    A, y = A - A.mean(axis=0), measured - measured.mean()
    own = effect.amplitude_parameters
    ends = np.array([[p.lower - p.value, p.upper - p.value] for p in own]) / change[:, None]
    bounds = np.vstack(([-np.inf, np.inf], np.sort(ends, axis=1)))
    fitted = lsq_linear(A, y, (bounds[:, 0], bounds[:, 1]))
    return float(2.0 * fitted.cost / (y @ y))
