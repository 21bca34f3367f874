"""Recordings cut into windows for one model, and all predictions as one column of rows.

Rows are ordered by window, then by group of channels that share their stamps, then by run without gaps, then by time;
a block is one such run. The rows of a window are therefore contiguous, which lets its initial states be
projected out by themselves.
"""

import os
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from discrepancy.model import Model, Parameter, Window
from discrepancy.recording import Array, Complaint, Recording, Signal, cleaned
from discrepancy.sensors import through_sensors
from discrepancy.units import parse_unit

GAP = 3.5  # in median sample times: a longer pause starts a new run of the whitening filter
OWN_SHARE = (
    0.5  # of what other parameters may move, that a parameter may before its own sensitivity is computed anew
)
FITTED_SHARE = (
    0.2  # of what parameters may move, that they may before derivatives are: these decide where a fit ends
)
OUTPUTS = "outputs"  # in place of a channel's name, in complaints about all of them
MILLI = 3e-3  # of the model's step or its inverse, beyond which stamps are likely in ms or in s by mistake
HOLD_TOLERANCE = 1e-3  # of a grid step, by which a held value may be stamped late and still be of this point
PLACES = 2  # at which sensitivities are kept: beside a strained fit its priors, to which it returns
RECENT = 4  # predictions kept: a step that was tried is where the next begins
FEWEST_SAMPLES = 8  # of a channel in a window; fewer say nothing beyond the initial state


@dataclass(frozen=True, slots=True)
class Block:
    """A run of n samples of c channels with common stamps: rows[start:stop], shape (n, c) in C order."""

    window: int
    group: int
    channels: tuple[str, ...]
    time_s: Array
    start: int

    @property
    def shape(self) -> tuple[int, int]:
        return self.time_s.size, len(self.channels)

    @property
    def stop(self) -> int:
        return self.start + self.time_s.size * len(self.channels)


@dataclass(frozen=True, slots=True)
class Values:
    """Parameters: `shared` by all windows, `local` one value per window (n_windows,); spells: windows outside which a shared one is `off`."""

    shared: Mapping[str, float]
    local: Mapping[str, Array]
    spells: Mapping[str, range] = field(default_factory=dict)
    off: Mapping[str, float] = field(default_factory=dict)

    def having(self, **changes: float) -> "Values":
        """A copy with some shared values changed."""
        return self.with_shared(changes)

    def with_shared(self, changes: Mapping[str, float]) -> "Values":
        return replace(self, shared={**self.shared, **changes})

    def acting(self, parameters: Iterable[Parameter], windows: range) -> "Values":
        """A copy in which these parameters have their values in some windows only."""
        names = {p.name: p.value for p in parameters}
        return replace(
            self, spells={**self.spells, **dict.fromkeys(names, windows)}, off={**self.off, **names}
        )

    def same(self, other: "Values") -> bool:
        """Whether a model would say the same of both."""
        return (self.shared, self.spells, self.off) == (other.shared, other.spells, other.off) and all(
            np.array_equal(values, other.local[name]) for name, values in self.local.items()
        )

    def in_window(self, index: int) -> dict[str, float]:
        resting = {name: self.off[name] for name, windows in self.spells.items() if index not in windows}
        local = {name: float(values[index]) for name, values in self.local.items()}
        return {**self.shared, **resting, **local}


class Unusable(ValueError):
    """Nothing can be concluded from these recordings with this model; the fatal complaints say why."""

    def __init__(self, complaints: Sequence[Complaint]) -> None:
        self.reasons = [c.told for c in complaints if c.fatal] or ["no recordings were given"]
        super().__init__("; ".join(self.reasons))
        self.complaints = tuple(complaints)


class Problem:
    """One model on some recordings. `simulations` counts calls of predict, the unit of cost."""

    def __init__(self, model: Model, recordings: Sequence[Recording]) -> None:
        self.model = model
        self.complaints: list[Complaint] = []
        self.simulations = 0
        self.windows: list[Window] = []
        self.blocks: list[Block] = []
        self._groups: dict[tuple[str, ...], int] = {}
        measured: list[Array] = []
        rows = 0
        for recording in recordings:
            clean, complaints = cleaned(recording)
            self.complaints += complaints
            usable = self._usable(clean)
            if usable is None:
                continue
            outputs, interval = usable
            before = len(self.windows)
            for window in cut(model, clean, interval):
                index = len(self.windows)
                runs = list(_runs(window, {name: clean.signals[name] for name in outputs}))
                if not runs:
                    continue
                self.windows.append(window)
                for channels, time_s, values in runs:
                    group = self._groups.setdefault(channels, len(self._groups))
                    self.blocks.append(Block(index, group, channels, time_s, rows))
                    measured.append(values.ravel())
                    rows += values.size
            if len(self.windows) == before:
                low, high = interval
                text = (
                    f"have no {FEWEST_SAMPLES} samples in a row from {low:.6g} to {high:.6g} s, where all inputs exist"
                    f"{_odd_stamps(model, clean.signals[outputs[0]])}"
                )
                self.complaints.append(Complaint(recording.name, OUTPUTS, text, fatal=True))
        if not self.windows:
            raise Unusable(self.complaints)
        self.measured = np.concatenate(measured)
        self.channels = tuple(dict.fromkeys(name for block in self.blocks for name in block.channels))
        self.missing = tuple(name for name in model.outputs if name not in self.channels)
        self.row_window, self.row_channel, self.row_time = self._labels()
        self.local_names = tuple(p.name for p in model.nuisances if p.scope == "window")
        self.nuisance_names = tuple(p.name for p in model.nuisances if p.scope == "all")
        shared = [p for p in model.parameters if p.scope == "all"]
        self._shared = [p.name for p in shared]
        self._typical = np.array([p.typical for p in shared])
        self._slopes: dict[tuple[str, float | None], deque[tuple[Array, Array]]] = {}
        self._recent: deque[tuple[Values, Array]] = deque(maxlen=RECENT)
        self._places = [_Place.on(self.windows[b.window].time_s, b.time_s) for b in self.blocks]

    def _usable(self, recording: Recording) -> tuple[list[str], tuple[float, float]] | None:
        """Channels to score and the interval in which all inputs exist; complaints say what is wrong."""

        def complain(name: str, text: str, *, fatal: bool) -> None:
            self.complaints.append(Complaint(recording.name, name, text, fatal))

        model, fine = self.model, True
        wanted = {**model.inputs, **model.optional, **model.outputs}
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
        end = min(s.time_s[-1] for s in driving) if model.inputs else max(s.time_s[-1] for s in driving)
        if end - start < FEWEST_SAMPLES * model.step_s:
            text = _apart(recording, driving, start, end) + _odd_stamps(model, driving[0])
            complain("inputs", text, fatal=True)
            return None
        return outputs, (float(start), float(end))

    def _labels(self) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
        window = np.empty(self.measured.size, np.intp)
        channel, time_s = np.empty_like(window), np.empty(self.measured.size)
        number = {name: i for i, name in enumerate(self.channels)}
        for block in self.blocks:
            rows, (n, c) = slice(block.start, block.stop), block.shape
            window[rows] = block.window
            channel[rows] = np.tile([number[name] for name in block.channels], n)
            time_s[rows] = np.repeat(block.time_s, c)
        return window, channel, time_s

    def start(self) -> Values:
        """The baseline: every effect off, initial states at their guess."""
        shared = {p.name: p.value for p in self.model.parameters if p.scope == "all"}
        local = {
            p.name: np.array([p.guess(w) if p.guess else p.value for w in self.windows])
            for p in self.model.nuisances
            if p.scope == "window"
        }
        return Values(shared, local)

    def outputs(
        self, index: int, values: Values, extra: Mapping[str, Array] | None = None
    ) -> dict[str, Array]:
        """Sensor outputs on the grid of one window."""
        parameters = values.in_window(index)
        return self._sensed(
            index, self.model.simulate(self.windows[index], parameters, extra or {}), parameters
        )

    def _sensed(
        self, index: int, true: Mapping[str, Array], parameters: dict[str, float]
    ) -> dict[str, Array]:
        window = self.windows[index]
        for clock in [c for c in self.model.clocks if c.recording == window.recording]:
            for name in clock.channels:
                late = parameters.get(f"{name}.delay", 0.0) + parameters[clock.parameter]
                parameters[f"{name}.delay"] = late
        since_s, lags = self.windows[0].start_s, self.model.lags
        return through_sensors(true, parameters, window.time_s, window.step_s, since_s, lags)

    def settle(self, values: Values) -> None:
        """Tell a model that keeps a motion to start from (Simulate) what is known of its parameters by now."""
        settle = getattr(self.model.simulate, "settle", None)
        if settle is not None:
            settle({**values.shared, **values.off})
            self._recent.clear()

    def predict(self, values: Values, extra: Sequence[Mapping[str, Array]] | None = None) -> Array:
        """Rows of the predicted outputs, kept for a while and read-only; extra: per window, what is added at the model's ports."""
        if extra is not None:
            self.simulations += 1
            return self._predicted(values, extra)
        for known, rows in self._recent:
            if known.same(values):
                return rows
        self.simulations += 1
        rows = self._predicted(values)
        rows.flags.writeable = False
        self._recent.appendleft((values, rows))
        return rows

    def predict_each(self, points: Sequence[Values]) -> list[Array]:
        """Rows at many points, in threads where the model may run in several."""
        self.simulations += len(points)
        if not self.model.threads or len(points) < 2:
            return [self._predicted(values) for values in points]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return list(pool.map(self._predicted, points))

    def kept_slope(
        self, name: str, probe: float | None, values: Values, *, anywhere: bool = False
    ) -> Array | None:
        """What `keep_slope` was given for a parameter and a probe nearest to here, if parameters have hardly moved since (Model.slopes_hold),
        or anywhere.
        """
        kept = self._slopes.get((name, probe))
        if not kept:
            return None
        here = self._scaled(values)
        moved, column = min(
            ((np.abs(here - at), column) for at, column in kept), key=lambda k: float(np.max(k[0]))
        )
        if anywhere:
            return column
        own = self._shared.index(name)
        hold = self.model.slopes_hold * (FITTED_SHARE if probe is None else 1.0)
        if moved[own] > OWN_SHARE * hold or np.max(moved) > hold:
            return None
        return column

    def keep_slope(self, name: str, probe: float | None, values: Values, column: Array) -> None:
        """Keep a column of the sensitivities; probe: the finite change it is for, None for a derivative."""
        if self.model.costly and name not in self.local_names:
            kept = self._slopes.setdefault((name, probe), deque(maxlen=PLACES))
            kept.append((self._scaled(values), column))

    def _scaled(self, values: Values) -> Array:
        """Shared parameters in typical changes."""
        shared = np.array([values.shared[name] for name in self._shared])
        return np.asarray(shared / self._typical, float)

    def _predicted(self, values: Values, extra: Sequence[Mapping[str, Array]] | None = None) -> Array:
        rows = np.empty(self.measured.size)
        seen = self._all_outputs(values, extra)
        for block, place in zip(self.blocks, self._places, strict=True):
            outputs = seen[block.window]
            for i, name in enumerate(block.channels):
                rows[block.start + i : block.stop : len(block.channels)] = place.of(outputs[name])
        return rows

    def _all_outputs(
        self, values: Values, extra: Sequence[Mapping[str, Array]] | None
    ) -> list[dict[str, Array]]:
        together = getattr(self.model.simulate, "together", None)
        if extra or self.local_names or values.spells or together is None:
            return [self.outputs(i, values, extra[i] if extra else None) for i in range(len(self.windows))]
        motions = together(self.windows, values.shared)
        return [self._sensed(i, true, dict(values.shared)) for i, true in enumerate(motions)]


@dataclass(frozen=True, slots=True)
class _Place:
    """Where on a grid stamps lie: linear between `before` and the point after it."""

    before: NDArray[np.intp]
    part: Array | None

    @classmethod
    def on(cls, grid: Array, time_s: Array) -> "_Place":
        at = np.clip(np.searchsorted(grid, time_s, side="right") - 1, 0, max(grid.size - 2, 0))
        part = (time_s - grid[at]) / (grid[at + 1] - grid[at]) if grid.size > 1 else np.zeros(time_s.size)
        whole: Array = np.round(part)
        if np.all(np.abs(part - whole) < 1e-6):
            return cls(at + whole.astype(np.intp), None)
        return cls(at, np.clip(part, 0.0, 1.0))

    def of(self, values: Array) -> Array:
        """Values at the stamps."""
        if self.part is None:
            return np.asarray(values[self.before], float)
        rise = values[self.before + 1] - values[self.before]
        return np.asarray(values[self.before] + self.part * rise, float)


def _apart(recording: Recording, driving: Sequence[Signal], start: float, end: float) -> str:
    if end >= start:
        return f"exist together for only {end - start:.3g} s"
    names = {id(s): name for name, s in recording.signals.items()}
    spans = ", ".join(f"{names[id(s)]} {s.time_s[0]:.6g} to {s.time_s[-1]:.6g} s" for s in driving)
    return f"have no time in common ({spans}): recorded with different clocks?"


def _useless(output: Signal) -> str:
    """Why nothing can be told from an output, in words; empty where something can."""
    if output.time_s.size < FEWEST_SAMPLES:
        return f"has {output.time_s.size} usable samples, {FEWEST_SAMPLES} needed"
    if np.ptp(output.value) == 0.0:
        return f"is constant at {output.value[0] + 0.0:g} {output.unit}: a dead sensor or an unused column"
    return ""


def _odd_stamps(model: Model, of: Signal) -> str:
    """A word on stamps whose distance is far from the model's step: the likely cause is their unit."""
    apart = float(np.median(np.diff(of.time_s)))
    if MILLI < apart / model.step_s < 1.0 / MILLI:
        return ""
    return f"; samples are {apart:.3g} s apart, the model steps by {model.step_s:g} s: is the time in another unit than its heading says?"


def cut(model: Model, recording: Recording, interval: tuple[float, float]) -> Iterable[Window]:
    """Windows of equal length near model.window_s, each with its lead-in as far as the recording has one."""
    start = interval[0]
    names = {**model.inputs, **model.optional, **model.outputs}
    for low, high in _spans(model, recording, interval):
        lead = max(low - model.step_s * round(model.lead_s / model.step_s), start)
        count = int(np.ceil((high - lead) / model.step_s - 1e-9)) + 1
        grid: Array = lead + model.step_s * np.arange(count, dtype=np.float64)
        known = {
            name: resampled(s, grid)
            for name, s in recording.signals.items()
            if name in names and s.time_s.size > 1
        }
        yield Window(
            recording=recording.name,
            start_s=float(low),
            end_s=float(high),
            time_s=grid,
            step_s=model.step_s,
            known=known,
            constants=recording.constants,
        )


def _spans(model: Model, recording: Recording, interval: tuple[float, float]) -> list[tuple[float, float]]:
    """From when to when each window is scored, on one grid through the recording: even sampling then meets even steps."""
    start, end = interval

    def on_grid(time_s: Array) -> Array:
        return np.asarray(start + model.step_s * np.round((time_s - start) / model.step_s), float)

    if model.stretches is not None:
        chosen = np.array(model.stretches(recording, interval))
        return [(low, high) for low, high in np.clip(on_grid(chosen), start, end).tolist()]
    count = max(1, round((end - start) / model.window_s)) if model.window_s else 1
    edges = np.linspace(start, end, count + 1)
    edges[1:-1] = on_grid(edges[1:-1])
    return list(pairwise(edges.tolist()))


def resampled(source: Signal, grid: Array) -> Array:
    """Values on the grid: linear between samples, or the last value for held signals."""
    if not source.held:
        return np.interp(grid, source.time_s, source.value)
    # stamps that count from 1970 are rounded to 0.24 µs, and no value may stand a step too long for that
    until = grid + HOLD_TOLERANCE * (grid[1] - grid[0]) if grid.size > 1 else grid
    return source.value[np.clip(np.searchsorted(source.time_s, until, side="right") - 1, 0, None)]


def _runs(window: Window, outputs: Mapping[str, Signal]) -> Iterable[tuple[tuple[str, ...], Array, Array]]:
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
        for run in np.split(inside, np.flatnonzero(pauses > GAP * np.median(pauses)) + 1):
            if run.size >= FEWEST_SAMPLES:
                yield (
                    tuple(names),
                    stamps[run],
                    np.stack([outputs[name].value[run] for name in names], axis=1),
                )
