"""Finds channels whose heading or clock is wrong: a factor between units, a wrong sign, or stamps of another clock.

These are errors of the recording and not physics; no effect of a library may be named for them. The model's prediction
with free initial states is compared with what was measured, channel by channel: a slope near a factor between units of
the same quantity, or a shift in time beyond any sensor's delay that halves the misfit.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy import gates
from discrepancy.checks.shifts import shifted_correlation
from discrepancy.estimation.effort import BRIEF
from discrepancy.estimation.fit import WindowStates, differences, fit
from discrepancy.estimation.noise import white_noise
from discrepancy.estimation.problem import Problem, Unusable, Values
from discrepancy.model.description import Model
from discrepancy.model.sensors import LONGEST_DELAY_S
from discrepancy.signals.recording import Array, Complaint
from discrepancy.signals.units import confusions

ALIKE: Final = gates.SAME_QUANTITY.threshold
NEAR: Final = gates.UNIT_FACTOR.threshold
OTHER_CLOCK: Final = gates.OTHER_CLOCK.threshold
FEWEST: Final = gates.SAMPLES_TO_CHECK.threshold
LONGEST_SHIFT_S = 30.0  # largest shift that is tried
SHIFTS = 160  # tried in either direction
ROWS = 6_000  # of a channel, used for the shifts: enough for a correlation, and the cost is rows times shifts


@dataclass(frozen=True, slots=True)
class _Part:
    """Rows of one channel of one recording."""

    recording: str
    channel: str
    rows: NDArray[np.bool_]


def failing_channels(problem: Problem) -> list[Complaint]:
    """One complaint per channel with a wrong scale, sign or clock. Raises Unusable if the model diverges."""
    start = problem.start()
    base = problem.predict(start)
    diverged = problem.diverged(base)
    if diverged.any():
        raise Unusable([_unbounded(problem, int(np.argmax(diverged)))])
    local = differences(problem, start, base, problem.local_names)
    scaled = _scaled_base(problem, start, base)
    found = []
    for part in _parts(problem):
        complaint = _synchrony(problem, part, base, local) or _scale(problem, part, scaled, local)
        if complaint:
            found.append(complaint)
    return found


def _unbounded(problem: Problem, row: int) -> Complaint:
    recording = problem.windows[problem.row_window[row]].recording
    text = (
        f"cannot be predicted at {problem.row_time[row]:.3g} s: the model {problem.model.name} gives no finite number there;"
        " is an input or a constant in another unit than its heading states?"
    )
    return Complaint(recording, problem.channels[problem.row_channel[row]], text, fatal=True)


def _parts(problem: Problem) -> Iterator[_Part]:
    owner = np.array([w.recording for w in problem.windows])[problem.row_window]
    for recording in dict.fromkeys(w.recording for w in problem.windows):
        for i, channel in enumerate(problem.channels):
            rows = (owner == recording) & (problem.row_channel == i)
            if np.count_nonzero(rows) >= FEWEST:
                yield _Part(recording, channel, rows)


def _scaled_base(problem: Problem, start: Values, base: Array) -> Array:
    """The prediction (N,) with nuisances without a prior fitted: one of them may be a scale, which would look like a wrong unit."""
    free = [p.name for p in problem.model.nuisances if p.scope == "all" and p.prior_sd is None]
    if not free:
        return base
    noise = white_noise(problem, problem.measured - base)
    with np.errstate(all="ignore"):
        return problem.predict(fit(problem, noise, free, start, effort=BRIEF).values)


def _scale(problem: Problem, part: _Part, base: Array, local: Array) -> Complaint | None:
    states = WindowStates(local, problem.row_window, part.rows)
    measured, predicted = states.off(problem.measured)[part.rows], states.off(base)[part.rows]
    power = float(predicted @ predicted)
    if power == 0.0:
        return None
    slope = float(measured @ predicted) / power
    alike = slope * np.sqrt(power / max(float(measured @ measured), 1e-300))
    model = problem.model
    if alike < -ALIKE and abs(slope + 1.0) < NEAR and not _may_be_reversed(model, part.channel):
        text = (
            f"moves opposite to the model's prediction (correlation {alike:.2f}): does it, or an input, have the wrong sign? "
            "Left out; correct the sign and diagnose again"
        )
        return Complaint(part.recording, part.channel, text, fatal=True)
    if alike < ALIKE:
        return None
    blamed = [(part.channel, model.outputs[part.channel], slope)]
    blamed += [(name, unit, 1.0 / slope) for name, unit in model.inputs.items()]
    likely = [
        f"{name} in {likely_unit}"
        for name, unit, ratio in blamed
        for likely_unit, factor in confusions(unit).items()
        if abs(ratio / factor - 1.0) < NEAR
    ]
    if not likely:
        return None
    text = (
        f"moves {slope:.4g} times as much as the model predicts (correlation {alike:.2f}), a factor between units: "
        f"{' or '.join(likely)}? Left out; correct the heading and diagnose again"
    )
    return Complaint(part.recording, part.channel, text, fatal=True)


def _may_be_reversed(model: Model, channel: str) -> bool:
    """Whether the library contains a wrong sign of the channel: then the search may find it, with evidence."""
    return any(p.name == f"{channel}.sign" for p in model.parameters)


def _synchrony(problem: Problem, part: _Part, base: Array, local: Array) -> Complaint | None:
    rows = np.flatnonzero(part.rows)
    rows = rows[:: max(1, rows.size // ROWS)]
    time_s, y = problem.row_time[rows], problem.measured[rows]
    duration = float(np.ptp(time_s))
    allowed = _longest_delay(problem, part.channel)
    reach = min(LONGEST_SHIFT_S, 0.25 * duration)
    if reach <= 2.0 * allowed:
        return None
    step = max(problem.model.step_s, float(np.median(np.abs(np.diff(time_s)))), reach / SHIFTS)
    shifts = step * np.arange(-int(reach / step), int(reach / step) + 1)
    order = np.argsort(time_s)
    source = time_s[order], y[order]
    likeness = shifted_correlation(problem, rows, base, local, source, shifts, centred=True)
    inner, best = float(np.max(likeness[np.abs(shifts) <= allowed + step])), int(np.argmax(likeness))
    late, alike = float(shifts[best]), float(likeness[best])
    if abs(late) <= allowed + step or not alike >= ALIKE or 1.0 - alike**2 > OTHER_CLOCK * (1.0 - inner**2):
        return None
    text = (
        f"fits the inputs {abs(late):.2f} s {'later' if late > 0 else 'earlier'} than its stamps say (correlation {alike:.2f} against "
        f"{inner:.2f}): recorded with another clock? Left out; try again with --shift {part.channel}={-late:.2f}"
    )
    return Complaint(part.recording, part.channel, text, fatal=True)


def _longest_delay(problem: Problem, channel: str) -> float:
    """Longest delay that an effect of the library can explain [s]."""
    bounds = [p.upper for p in problem.model.parameters if p.name == f"{channel}.delay"]
    return max([b for b in bounds if np.isfinite(b)], default=LONGEST_DELAY_S)
