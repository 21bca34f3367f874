"""Joins files of one run that were stamped by different clocks: estimates the offset between the clocks with the model.

Outputs of one file are shifted against the model's prediction from the inputs of another. A missing effect would bias the offset, so the
remaining offset is fitted with everything else, as a nuisance. Clocks that agree within the longest delay of a sensor are not changed: the
difference is then a delay, which the library can name. Where a clock was set, a delay common to all channels of that file cannot be
distinguished from the clock.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy import gates
from discrepancy.checks.shifts import shifted_correlation
from discrepancy.estimation.fit import differences
from discrepancy.estimation.problem import Problem, Unusable
from discrepancy.model.description import Clock, Model, Parameter
from discrepancy.model.sensors import LONGEST_DELAY_S
from discrepancy.signals.recording import Array, Complaint, Recording, Signal, cleaned

# In lengths of the run. Stamps that begin later than that count from a date (1970), and lose digits as floats; they are then counted from
# the start of the run.
DISTANT = 10.0
UNSURE_S = 0.5  # standard deviation of an estimated offset, as the prior of its remainder
OVERLAP: Final = gates.FILES_OVERLAP.threshold
REACH_S = 30.0  # largest offset that is tried
ALIKE: Final = gates.SAME_QUANTITY.threshold


@dataclass(frozen=True, slots=True)
class Joined:
    """A run joined from several files."""

    recording: Recording
    offset_s: tuple[float, ...]  # added to the stamps of each file
    complaints: tuple[Complaint, ...]  # about the clocks
    clocks: tuple[Clock, ...]  # those that were set; their remaining offset is fitted


def join(model: Model, parts: Sequence[Recording], name: str) -> Joined:
    """The files of one run, on the clock of the first file that contains an input."""
    first = next((i for i, p in enumerate(parts) if any(n in p.signals for n in model.inputs)), 0)
    start, end = _span(parts[first])
    origin = start if abs(start) > DISTANT * (end - start) else 0.0
    offsets, complaints, clocks = [], [], []
    for i, part in enumerate(parts):
        offset, text, was_set = (
            (-origin, "", False) if i == first else _offset(model, parts[first], part, origin)
        )
        offsets.append(offset)
        if text:
            complaints.append(Complaint(name, "", f"{part.name} {text}"))
        if was_set:
            clocks.append(_clock(model, parts[first], part, name))
    complaints += _twice(parts, first, name)
    moved = [_shifted(part, offset) for part, offset in zip(parts, offsets, strict=True)]
    return Joined(_merged(moved, first, name), tuple(offsets), tuple(complaints), tuple(clocks))


def _twice(parts: Sequence[Recording], first: int, name: str) -> list[Complaint]:
    """Channels that more than one file has."""
    holders = {n: [p.name for p in parts if n in p.signals] for p in parts for n in p.signals}
    several = [n for n, files in holders.items() if len(files) > 1]
    if not several:
        return []
    text = (
        f"{', '.join(several)}: in more than one of the files joined by '+'; those of {parts[first].name} are used where it has them. "
        "If the files are different runs, give them as separate recordings"
    )
    return [Complaint(name, "", text)]


def with_clocks(model: Model, clocks: Sequence[Clock]) -> Model:
    """The model with the remaining offset of each clock as a nuisance."""
    limit = 4.0 * UNSURE_S
    nuisances = [
        Parameter(name=c.parameter, unit="s", lower=-limit, upper=limit, typical=0.05, prior_sd=UNSURE_S)
        for c in clocks
    ]
    return replace(model, nuisances=(*model.nuisances, *nuisances), clocks=(*model.clocks, *clocks))


def _clock(model: Model, reference: Recording, part: Recording, name: str) -> Clock:
    outputs = [n for n in model.outputs if n in part.signals and n not in reference.signals]
    if outputs:
        return Clock(f"clock of {part.name}", name, tuple(outputs))
    # a file of inputs only has no outputs to shift: shift all other outputs instead, in the opposite direction
    return Clock(
        f"clock against {part.name}", name, tuple(n for n in model.outputs if n in reference.signals)
    )


def _offset(model: Model, reference: Recording, part: Recording, origin: float) -> tuple[float, str, bool]:
    coarse = -origin
    (start, end), (other_start, other_end) = _span(reference), _span(part)
    shared = min(end, other_end) - max(start, other_start)
    apart = shared < OVERLAP * min(end - start, other_end - other_start)
    if apart:
        coarse += start - other_start
    based = _shifted(reference, -origin)
    fine, alike = estimate_offset(model, based, _shifted(part, coarse))
    if alike < ALIKE:
        assumed = "both files are assumed to start together" if apart else "the stamps are not changed"
        text = f"could not be synchronised by the model (correlation {alike:.2f}); {assumed}; --shift sets an offset"
        return coarse, text, False
    if not apart and abs(fine) <= LONGEST_DELAY_S:
        text = f"agrees with the other clock within {abs(fine):.2f} s; not changed, a difference shows as a delay"
        return coarse, text, False
    text = (
        f"is on another clock: {coarse + origin + fine:+.2f} s added to its stamps (correlation {alike:.2f}), the remainder is fitted; "
        "a delay common to all its channels cannot be distinguished from this offset"
    )
    return coarse + fine, text, True


def estimate_offset(model: Model, reference: Recording, part: Recording) -> tuple[float, float]:
    """Seconds to add to the stamps of `part` so that the model fits best, and the correlation reached; (0, 0) if the model cannot determine it."""
    merged = _merged([reference, part], 0, reference.name)
    try:
        problem = Problem(model, [merged])
    except Unusable:
        return 0.0, 0.0
    start = problem.start()
    base = problem.predict(start)
    if problem.diverged(base).any():
        return 0.0, 0.0
    inputs_there = all(n in reference.signals for n in model.inputs)
    channels = [c for c in problem.channels if (c in part.signals) == inputs_there]
    if not channels:
        return 0.0, 0.0
    local = differences(problem, start, base, problem.local_names)
    clean, _ = cleaned(merged)
    whole = {name: clean.signals[name] for name in channels}
    length = float(np.ptp(problem.row_time))
    step, reach = model.step_s, min(REACH_S, 0.4 * length)
    coarse = max(step, reach / 200)
    shifts = coarse * np.arange(-int(reach / coarse), int(reach / coarse) + 1)
    best = _best(shifts, _misfit(problem, whole, base, local, shifts))
    fine = np.asarray(best + coarse * np.linspace(-1.5, 1.5, 31), float)
    misfit = _misfit(problem, whole, base, local, fine)
    late = _best(fine, misfit)
    # the geometric mean over channels of 1 - correlation², turned back into one correlation
    alike = float(np.sqrt(max(0.0, 1.0 - np.exp(float(np.min(misfit)) / len(channels)))))
    return (-late if inputs_there else late), alike


def _misfit(
    problem: Problem, whole: Mapping[str, Signal], base: Array, local: Array, shifts: NDArray[np.floating]
) -> Array:
    """Sum over channels of ln(1 - correlation²) for each shift; whole: all samples of a channel, also outside of the scored interval, from which shifted readings come."""
    total = np.zeros(shifts.size)
    for channel, signal in whole.items():
        rows = np.flatnonzero(problem.row_channel == problem.channels.index(channel))
        source = signal.time_s, signal.value
        share = shifted_correlation(problem, rows, base, local, source, shifts, centred=False) ** 2
        total += np.log(np.maximum(1.0 - share, 1e-12))
    return total


def _best(shifts: NDArray[np.floating], misfit: Array) -> float:
    """The shift at the minimum, refined by a parabola through its neighbours."""
    i = int(np.argmin(misfit))
    if i in (0, shifts.size - 1):
        return float(shifts[i])
    a, b, c = misfit[i - 1 : i + 2]
    bend = a - 2.0 * b + c
    return float(shifts[i] + (shifts[1] - shifts[0]) * (0.5 * (a - c) / bend if bend > 0.0 else 0.0))


def _span(part: Recording) -> tuple[float, float]:
    stamped = [s.time_s for s in part.signals.values() if s.time_s.size]
    if not stamped:
        return 0.0, 0.0
    return min(float(np.nanmin(t)) for t in stamped), max(float(np.nanmax(t)) for t in stamped)


def _shifted(part: Recording, offset: float) -> Recording:
    moved = {n: Signal(s.time_s + offset, s.value, s.unit, s.held) for n, s in part.signals.items()}
    return replace(part, signals=moved)


def _merged(parts: Sequence[Recording], first: int, name: str) -> Recording:
    """One recording with the channels of all parts; of a channel in two parts, that of the part with the inputs is used."""
    signals: dict[str, Signal] = {}
    constants: dict[str, float] = {}
    for part in [*(p for i, p in enumerate(parts) if i != first), parts[first]]:
        signals |= part.signals
        constants |= part.constants
    return Recording(name, signals, constants)
