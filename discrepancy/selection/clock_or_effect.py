"""A clock or a unit that seems wrong, or an effect of the library?

A strong effect that the baseline lacks may look like stamps of another clock: on a bank the roll angle follows the heading, and the
prediction without the bank, shifted by some seconds, follows it too. Or like another unit: without the pile that stopped it, the simulated
machine rolls over, and its wheel loads move ten times as much. The recording is blamed only where no effect explains the channel
better at its own stamps and in its own unit, alone or with others.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import lsq_linear

from discrepancy.checks.channel_checks import AnotherClock, AnotherUnit
from discrepancy.estimation.fit import WindowStates, differences
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Parameter
from discrepancy.selection.screen import sensitivities
from discrepancy.signals.recording import Array, Complaint


def still_blamed(problem: Problem, complaints: Sequence[Complaint]) -> list[Complaint]:
    """The complaints, without those on clocks and units of channels that the library explains better than the shift or the factor does, by one effect or by all at once, or that would need two clocks for one column of stamps."""
    clocks = [c for c in complaints if isinstance(c, AnotherClock)]
    at_odds = {c for c in clocks if any(_of_two_clocks(problem, c, other) for other in clocks)}
    complaints = [c for c in complaints if c not in at_odds]
    suspected = [c for c in complaints if isinstance(c, AnotherClock | AnotherUnit)]
    if not suspected:
        return complaints  # without the cost of trying every effect
    start = problem.start()
    base = problem.predict(start)
    local = differences(problem, start, base, problem.local_names)
    tried = sensitivities(problem, start, base, problem.model.effects)
    owner = np.array([w.recording for w in problem.windows])[problem.row_window]

    def left(complaint: AnotherClock | AnotherUnit) -> Iterator[float]:
        rows = (owner == complaint.recording) & (
            problem.row_channel == problem.channels.index(complaint.signal)
        )
        states = WindowStates(local[rows], problem.row_window[rows], np.ones(np.count_nonzero(rows), bool))
        measured, predicted = states.off(problem.measured[rows]), states.off(base[rows])
        share = _left if isinstance(complaint, AnotherClock) else _left_in_its_unit
        for columns in tried:
            for raw, change in zip(columns.raw, columns.changes, strict=True):
                own = columns.effect.amplitude_parameters
                yield share(own, change, measured, predicted, states.off(raw[rows]))
        # a joint that has dry and viscous friction is late by neither alone
        every = [p for columns in tried for p in columns.effect.amplitude_parameters]
        first = np.concatenate([columns.changes[0] for columns in tried])
        changed = np.hstack([states.off(columns.raw[0][rows]) for columns in tried])
        yield share(every, first, measured, predicted, changed)

    cleared = {c for c in suspected if any(share < c.left for share in left(c))}
    return [c for c in complaints if c not in cleared]


def _of_two_clocks(problem: Problem, one: AnotherClock, other: AnotherClock) -> bool:
    """Whether two channels with the same stamps fit at different shifts: their stamps have one clock, so that it is not wrong by both."""
    together = any({one.signal, other.signal} <= {*b.channels} for b in problem.blocks)
    apart = abs(one.late_s - other.late_s) > one.step_s + other.step_s
    return one.recording == other.recording and together and apart


def _left(
    parameters: Sequence[Parameter], change: Array, measured: Array, predicted: Array, changed: Array
) -> float:
    """Share of the channel's variance (n,) that the prediction and one effect or several leave, at the sizes within their bounds that fit best.

    parameters: their k amplitudes; changed: what the trial step `change` of each (k,) does to the channel (n, k). As for the shift, the size of the
    prediction and a zero point are free.
    """
    A = np.column_stack((predicted, changed))
    A, y = A - A.mean(axis=0), measured - measured.mean()
    bounds = np.vstack(([-np.inf, np.inf], _bounds(parameters, change)))
    fitted = lsq_linear(A, y, (bounds[:, 0], bounds[:, 1]))
    return float(2.0 * fitted.cost / (y @ y))


def _left_in_its_unit(
    parameters: Sequence[Parameter], change: Array, measured: Array, predicted: Array, changed: Array
) -> float:
    """As `_left`, of the channel as it was measured, and the size of the prediction is not free: it is what the unit would change."""
    bounds = _bounds(parameters, change)
    fitted = lsq_linear(changed, measured - predicted, (bounds[:, 0], bounds[:, 1]))
    return float(2.0 * fitted.cost / (measured @ measured))


def _bounds(parameters: Sequence[Parameter], change: Array) -> Array:
    """The least and most of each trial step (k, 2)."""
    ends = np.array([[p.lower - p.value, p.upper - p.value] for p in parameters]) / change[:, None]
    return np.asarray(np.sort(ends, axis=1), float)
