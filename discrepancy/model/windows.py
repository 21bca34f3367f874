"""A recording cut into windows for one model: its usable part, the grid, and blocks of samples without gaps."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy import gates
from discrepancy.model.description import Model, Window
from discrepancy.signals.recording import Array, Complaint, Recording, Signal
from discrepancy.signals.resampling import GAP, HOLD_TOLERANCE, course
from discrepancy.signals.units import parse_unit

OUTPUTS = "outputs"  # in place of a channel's name, in complaints about all of them
MILLI = 3e-3  # of the model's step or its inverse, beyond which stamps are likely in ms or in s by mistake
IN_STEP: Final = 0.9  # length of the mean of unit vectors at the phases of commands, from which they have one: they scatter by 7 % of a step
FEWEST_SAMPLES: Final = int(gates.SAMPLES_IN_A_BLOCK.threshold)  # of a channel in a window


@dataclass(frozen=True, slots=True)
class Block:
    """A block of n rows of c channels with common stamps: rows[start:stop], shape (n, c) in C order.

    A row is one sample, or the mean of `averaged` samples that follow one another, stamped at their mean time.
    """

    window: int
    group: int
    channels: tuple[str, ...]
    time_s: Array  # of the rows (n,)
    start: int
    samples: Array | None = None  # their stamps (n * averaged,); None: those of the rows
    averaged: int = 1

    @property
    def sample_s(self) -> Array:
        """Stamps of the samples (n * averaged,)."""
        return self.time_s if self.samples is None else self.samples

    @property
    def shape(self) -> tuple[int, int]:
        return self.time_s.size, len(self.channels)

    @property
    def stop(self) -> int:
        return self.start + self.time_s.size * len(self.channels)


@dataclass(frozen=True, slots=True)
class Place:
    """Where on a grid stamps lie: linear between `before` and the point after it."""

    before: NDArray[np.intp]
    part: Array | None

    @classmethod
    def on(cls, grid: Array, time_s: Array) -> "Place":
        at = np.clip(np.searchsorted(grid, time_s, side="right") - 1, 0, max(grid.size - 2, 0))
        part = (time_s - grid[at]) / (grid[at + 1] - grid[at]) if grid.size > 1 else np.zeros(time_s.size)
        whole: Array = np.round(part)
        if np.all(np.abs(part - whole) < 1e-6):
            return cls(at + whole.astype(np.intp), None)
        return cls(at, np.clip(part, 0.0, 1.0))

    def of(self, values: Array) -> Array:
        """Values (..., grid) at the stamps (..., n)."""
        before = np.take(values, self.before, axis=-1)
        if self.part is None:
            return np.asarray(before, float)
        return np.asarray(before + self.part * (np.take(values, self.before + 1, axis=-1) - before), float)


def usable(
    model: Model, recording: Recording, complaints: list[Complaint]
) -> tuple[list[str], tuple[float, float]] | None:
    """Channels to score and the interval in which all inputs exist; `complaints` gets what is wrong."""

    def complain(name: str, text: str, *, fatal: bool) -> None:
        complaints.append(Complaint(recording.name, name, text, fatal))

    fine = True
    wanted = {**model.driving, **model.outputs}
    for name in [name for name in wanted if name in recording.signals]:
        found, expected = recording.signals[name].unit, wanted[name]
        if not parse_unit(found).same_quantity(parse_unit(expected)):
            complain(name, f"is in {found}, the model {model.name} needs {expected}", fatal=True)
            fine = False
    for name, unit in model.constants.items():
        if name not in recording.constants:
            complain(name, f"is missing, a constant of each recording [{unit}]", fatal=True)
            fine = False
    for name in model.inputs:
        if name not in recording.signals:
            complain(
                name,
                f"is missing; the model {model.name} cannot be driven without this input",
                fatal=True,
            )
            fine = False
        elif recording.signals[name].time_s.size < 2:
            complain(name, "has fewer than 2 usable samples", fatal=True)
            fine = False
    there = [name for name in model.outputs if name in recording.signals]
    useless = {name: text for name in there if (text := _useless(recording.signals[name]))}
    outputs = [name for name in there if name not in useless]
    for name, text in useless.items():
        complain(name, text, fatal=not outputs)
    if not there:
        complain(OUTPUTS, f"none of {', '.join(model.outputs)} is there", fatal=True)
    fine = fine and bool(outputs)
    if not fine:
        return None
    driving = [recording.signals[name] for name in model.inputs] or [
        recording.signals[name] for name in outputs
    ]
    start = max(s.time_s[0] for s in driving) if model.inputs else min(s.time_s[0] for s in driving)
    last = max(recording.signals[name].time_s[-1] for name in outputs)
    end = min(min(_known_until(s), max(s.time_s[-1], last)) for s in driving) if model.inputs else last
    if end - start < FEWEST_SAMPLES * model.step_s:
        text = _apart(recording, driving, start, end) + odd_stamps(model, driving[0])
        complain("inputs", text, fatal=True)
        return None
    return outputs, (float(start), float(end))


def _known_until(source: Signal) -> float:
    """The last time at which a signal is known: what is held stays for as long as it has stayed before."""
    # not longer: a message of every 20 ms that comes no more is a node that has failed
    return float(source.time_s[-1] + (np.max(np.diff(source.time_s)) if source.held else 0.0))


def _apart(recording: Recording, driving: Sequence[Signal], start: float, end: float) -> str:
    if end >= start:
        return f"exist together for only {end - start:.3g} s"
    names = {id(s): name for name, s in recording.signals.items()}
    spans = ", ".join(f"{names[id(s)]} {s.time_s[0]:.6g} to {s.time_s[-1]:.6g} s" for s in driving)
    return f"have no time in common ({spans}): recorded with different clocks?"


def _useless(output: Signal) -> str:
    """Why an output is of no use, as a sentence; empty where it is."""
    if output.time_s.size < FEWEST_SAMPLES:
        return f"has {output.time_s.size} usable samples, {FEWEST_SAMPLES} needed"
    if np.ptp(output.value) == 0.0:
        return f"is constant at {output.value[0] + 0.0:g} {output.unit}: a dead sensor or an unused column"
    return ""


def odd_stamps(model: Model, of: Signal) -> str:
    """A word on stamps whose distance is far from the model's step: the likely cause is their unit."""
    apart = float(np.median(np.diff(of.time_s)))
    if MILLI < apart / model.step_s < 1.0 / MILLI:
        return ""
    return f"; samples are {apart:.3g} s apart, the model steps by {model.step_s:g} s: is the time in another unit than its heading says?"


def cut(
    model: Model,
    recording: Recording,
    interval: tuple[float, float],
    finer: int = 1,
    edges: Sequence[float] = (),
) -> Iterable[Window]:
    """Windows of equal length near model.window_s, each with its lead-in as far as the recording has one.

    finer: steps of the grid in one of the model. edges: times at which windows are cut beside their own ends [s].
    """
    interval = _in_step(model, recording, interval)
    start = interval[0]
    names = {**model.driving, **model.outputs}
    courses = {n: course(s) for n, s in recording.signals.items() if n in names and s.time_s.size > 1}
    for low, high in _spans(model, recording, interval, edges):
        lead = max(low - model.step_s * round(model.lead_s / model.step_s), start)
        count = int(np.ceil((high - lead) / model.step_s - 1e-9)) + 1
        grid: Array = lead + model.step_s / finer * np.arange(finer * (count - 1) + 1, dtype=np.float64)
        yield Window(
            recording=recording.name,
            start_s=float(low),
            end_s=float(high),
            time_s=grid,
            step_s=model.step_s / finer,
            known={name: values(grid) for name, values in courses.items()},
            constants=recording.constants,
        )


def _in_step(model: Model, recording: Recording, interval: tuple[float, float]) -> tuple[float, float]:
    """The interval from where grid points fall on the changes of held inputs; unchanged where these have no common phase.

    A command that comes within a step is known to the model by its mean alone, which bends what follows between grid points.
    """
    if model.segments is not None:
        return interval
    turns = np.zeros(0, complex)
    for name in [n for n in model.held if n in model.driving and n in recording.signals]:
        source = recording.signals[name]
        jumps = np.abs(np.diff(source.value))
        at = np.flatnonzero(jumps)
        if at.size:
            phase = (source.time_s[1 + at] - interval[0]) / model.step_s
            turns = np.append(turns, jumps[at] / np.mean(jumps[at]) * np.exp(2j * np.pi * phase))
    size = float(np.sum(np.abs(turns)))
    if size == 0.0 or abs(np.sum(turns)) < IN_STEP * size:
        return interval
    part = float(np.angle(np.sum(turns))) / (2.0 * np.pi) % 1.0
    if min(part, 1.0 - part) < HOLD_TOLERANCE:
        return interval
    return interval[0] + part * model.step_s, interval[1]


def _spans(
    model: Model, recording: Recording, interval: tuple[float, float], more: Sequence[float]
) -> list[tuple[float, float]]:
    """From when to when each window is scored, on one grid through the recording: even sampling then meets even steps."""
    start, end = interval

    def on_grid(time_s: Array) -> Array:
        return np.asarray(start + model.step_s * np.round((time_s - start) / model.step_s), float)

    at = on_grid(np.array(more))
    if model.segments is not None:
        chosen = np.array(model.segments(recording, interval))
        return _split(np.clip(on_grid(chosen), start, end).tolist(), at)
    count = max(1, round((end - start) / model.window_s)) if model.window_s else 1
    edges = np.linspace(start, end, count + 1)
    edges[1:-1] = on_grid(edges[1:-1])
    return _split(pairwise(edges.tolist()), at)


def _split(spans: Iterable[Sequence[float]], at: Array) -> list[tuple[float, float]]:
    """Spans in parts: each is cut at the times that lie within it."""
    return [
        part
        for low, high in spans
        for part in pairwise([low, *np.unique(at[(at > low) & (at < high)]).tolist(), high])
    ]


def sample_blocks(
    window: Window, outputs: Mapping[str, Signal]
) -> Iterable[tuple[tuple[str, ...], Array, Array]]:
    """Channels grouped by identical stamps, split at gaps: (names, stamps (n,), values (n, c))."""
    groups: dict[bytes, list[str]] = {}
    for name, output in outputs.items():
        groups.setdefault(output.time_s.tobytes(), []).append(name)
    last = outputs and max(s.time_s[-1] for s in outputs.values())
    for names in groups.values():
        stamps = outputs[names[0]].time_s
        upto = stamps <= window.end_s if window.end_s >= float(last or 0.0) else stamps < window.end_s
        inside = np.flatnonzero((stamps >= window.start_s) & upto)
        if inside.size < FEWEST_SAMPLES:
            continue
        pauses = np.diff(stamps[inside])
        # The upper quartile, not the median: samples may come in bursts, with every other pause a long one.
        usual = np.quantile(pauses, 0.75)
        for at in np.split(inside, np.flatnonzero(pauses > GAP * usual) + 1):
            if at.size >= FEWEST_SAMPLES:
                yield (
                    tuple(names),
                    stamps[at],
                    np.stack([outputs[name].value[at] for name in names], axis=1),
                )


def samples_per_row(time_s: Array, row_period_s: float) -> int:
    """How many samples of a block with these stamps make one row of about row_period_s; at least 1, and no more than leave enough rows."""
    step = float(np.median(np.diff(time_s)))
    most = time_s.size // FEWEST_SAMPLES
    return int(np.clip(round(row_period_s / step), 1, max(most, 1)))


def means_of(values: Array, each: int) -> Array:
    """Means (..., n) of `each` values (..., n * each) that follow one another."""
    return values if each == 1 else values.reshape(*values.shape[:-1], -1, each).mean(axis=-1)
