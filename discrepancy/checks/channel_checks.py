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
WITHIN_PRIORS: Final = gates.WITHIN_PRIORS.threshold
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


@dataclass(frozen=True, slots=True, kw_only=True)
class AnotherClock(Complaint):
    """A channel whose stamps may be of another clock."""

    left: float  # share of its variance that the prediction leaves at the best shift
    late_s: float  # the best shift
    step_s: float  # between the shifts that were tried


@dataclass(frozen=True, slots=True, kw_only=True)
class AnotherUnit(Complaint):
    """A channel that moves as predicted but for a factor between units."""

    left: float  # share of what was measured that the prediction leaves at the slope that fits best


def failing_channels(problem: Problem) -> list[Complaint]:
    """One complaint per channel with a wrong scale, sign or clock. Raises Unusable if the model diverges."""
    start = problem.start()
    base = _predicted(problem, start)
    diverged = problem.diverged(base)
    if diverged.any():
        raise Unusable([_unbounded(problem, int(np.argmax(diverged)))])
    local = differences(problem, start, base, problem.local_names)
    scaled = _scaled_base(problem, start, base)
    found: list[Complaint] = []
    suspected: list[tuple[_Part, Complaint]] = []
    for part in _parts(problem):
        if complaint := _synchrony(problem, part, base, local):
            found.append(complaint)
            continue
        slope, alike = _slope(problem, part, scaled, local)
        if complaint := _wrong_sign(problem, part, slope, alike):
            suspected.append((part, complaint))
        elif complaint := _wrong_unit(problem, part, slope, alike):
            found.append(complaint)
    if suspected:
        allowed = _predicted(problem, _within_priors(problem, start, base))
        found += [complaint for part, complaint in suspected if not _explains(problem, part, allowed, scaled)]
    return found


def _explains(problem: Problem, part: _Part, allowed: Array, base: Array) -> bool:
    """Whether a prediction takes most of another one's misfit away."""
    left, whole = ((problem.measured - rows)[part.rows] for rows in (allowed, base))
    return float(left @ left) < WITHIN_PRIORS * float(whole @ whole)


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
    return _predicted(problem, _fitted(problem, start, base, free)) if free else base


def _within_priors(problem: Problem, start: Values, base: Array) -> Values:
    """All nuisances fitted, none further from its prior than a nuisance may be.

    On an even drive a small zero error looks like a wrong sign: two constants, opposite to one another.
    """
    known = [p for p in problem.model.nuisances if p.scope == "all" and p.prior_sd is not None]
    values = _fitted(problem, start, base, [p.name for p in known]) if known else start
    reach = {p.name: gates.PRIOR_CONFLICT.threshold * (p.prior_sd or 0.0) for p in known}
    return values.with_shared(
        {
            p.name: min(max(values.shared[p.name], p.value - reach[p.name]), p.value + reach[p.name])
            for p in known
        }
    )


def _predicted(problem: Problem, values: Values) -> Array:
    with np.errstate(all="ignore"):  # a model may divide by zero where an input is in the wrong unit
        return problem.predict(values)


def _fitted(problem: Problem, start: Values, base: Array, free: list[str]) -> Values:
    noise = white_noise(problem, problem.measured - base)
    with np.errstate(all="ignore"):
        return fit(problem, noise, free, start, effort=BRIEF).values


def _slope(problem: Problem, part: _Part, base: Array, local: Array) -> tuple[float, float]:
    """Slope of the measured rows over the predicted ones and their correlation, initial states taken off; zeros where either is zero throughout."""
    states = WindowStates(local, problem.row_window, part.rows)
    measured, predicted = states.off(problem.measured)[part.rows], states.off(base)[part.rows]
    sizes = float(np.linalg.norm(measured)), float(np.linalg.norm(predicted))
    if 0.0 in sizes:
        return 0.0, 0.0
    alike = float((measured / sizes[0]) @ (predicted / sizes[1]))
    return alike * sizes[0] / sizes[1], alike


def _wrong_sign(problem: Problem, part: _Part, slope: float, alike: float) -> Complaint | None:
    """slope, alike: of `_slope`."""
    if alike >= -ALIKE or abs(slope + 1.0) >= NEAR or _may_be_reversed(problem.model, part.channel):
        return None
    text = (
        f"moves opposite to the model's prediction (correlation {alike:.2f}): does it, or an input, have the wrong sign? "
        "Left out; correct the sign and diagnose again"
    )
    return Complaint(part.recording, part.channel, text, fatal=True)


def _wrong_unit(problem: Problem, part: _Part, slope: float, alike: float) -> AnotherUnit | None:
    """slope, alike: of `_slope`."""
    if alike < ALIKE:
        return None
    model = problem.model
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
    return AnotherUnit(part.recording, part.channel, text, fatal=True, left=1.0 - alike**2)


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
        f"fits the inputs with stamps {abs(late):.2f} s {'earlier' if late > 0 else 'later'} (correlation {alike:.2f}, and {inner:.2f} within the "
        f"delay of a sensor): recorded with another clock? Left out; try again with --shift {part.channel}={-late:.2f}"
    )
    return AnotherClock(
        part.recording, part.channel, text, fatal=True, left=1.0 - alike**2, late_s=late, step_s=step
    )


def _longest_delay(problem: Problem, channel: str) -> float:
    """Longest delay that an effect of the library can explain [s]."""
    devices = {e.parameters[0].name for e in problem.model.effects if channel in e.readings}
    names = {f"{channel}.delay", *devices}
    bounds = [p.upper for p in problem.model.parameters if p.name in names]
    return max([b for b in bounds if np.isfinite(b)], default=LONGEST_DELAY_S)
