"""Recordings cut into windows for one model, and all predictions as one column of rows.

Rows are ordered by window, then by group of channels that share their stamps, then by run without gaps, then by time;
a block is one such run. The rows of a window are therefore contiguous, which lets its initial states be
projected out by themselves.
"""

import os
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.model import Model, Parameter, Window
from discrepancy.recording import Array, Complaint, Recording, cleaned
from discrepancy.sensors import through_sensors
from discrepancy.windows import FEWEST_SAMPLES, OUTPUTS, Block, Place, cut, odd_stamps, runs, usable

OWN_SHARE = (
    0.5  # of what other parameters may move, that a parameter may before its own sensitivity is computed anew
)
FITTED_SHARE = (
    0.2  # of what parameters may move, that they may before derivatives are: these decide where a fit ends
)
PLACES = 2  # at which sensitivities of finite changes are kept: beside a strained fit its priors, to which it returns
FITTED_PLACES = 6  # at which derivatives are: every effect that is tried takes them elsewhere, and then the next begins where they were
RECENT = 4  # predictions kept: a step that was tried is where the next begins


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
            found = usable(model, clean, self.complaints)
            if found is None:
                continue
            outputs, interval = found
            before = len(self.windows)
            for window in cut(model, clean, interval):
                index = len(self.windows)
                parts = list(runs(window, {name: clean.signals[name] for name in outputs}))
                if not parts:
                    continue
                self.windows.append(window)
                for channels, time_s, values in parts:
                    group = self._groups.setdefault(channels, len(self._groups))
                    self.blocks.append(Block(index, group, channels, time_s, rows))
                    measured.append(values.ravel())
                    rows += values.size
            if len(self.windows) == before:
                low, high = interval
                text = (
                    f"have no {FEWEST_SAMPLES} samples in a row from {low:.6g} to {high:.6g} s, where all inputs exist"
                    f"{odd_stamps(model, clean.signals[outputs[0]])}"
                )
                self.complaints.append(Complaint(recording.name, OUTPUTS, text, fatal=True))
        if not self.windows:
            raise Unusable(self.complaints)
        self.measured = np.concatenate(measured)
        self.channels = tuple(dict.fromkeys(name for block in self.blocks for name in block.channels))
        self.missing = tuple(name for name in model.outputs if name not in self.channels)
        self.row_window, self.row_channel, self.row_time = self._labels()
        self.local_names = tuple(p.name for p in model.nuisances if p.scope == "window")
        self.begin_names = tuple(p.name for p in model.nuisances if p.scope == "begin")
        self.nuisance_names = tuple(p.name for p in model.nuisances if p.scope == "all")
        shared = [p for p in model.parameters if p.scope != "window"]
        self._shared = [p.name for p in shared]
        self._typical = np.array([p.typical for p in shared])
        self._slopes: dict[tuple[str, float | None], deque[tuple[Array, Array]]] = {}
        self._recent: deque[tuple[Values, Array]] = deque(maxlen=RECENT)
        self._places = [Place.on(self.windows[b.window].time_s, b.time_s) for b in self.blocks]

    def read_as(self, values: Values) -> "Problem":
        """The same windows, had they read exactly what the model says of values; what was learned of sensitivities is shared."""
        rows = self.predict(values)
        other = copy(self)
        other.measured = rows
        return other

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
        shared = {p.name: p.value for p in self.model.parameters if p.scope != "window"}
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
        own = moved[self._shared.index(name)]
        hold = self.model.slopes_hold * (FITTED_SHARE if probe is None else 1.0)
        if own > OWN_SHARE * hold or np.max(moved) > hold:
            return None
        return column

    def keep_slope(self, name: str, probe: float | None, values: Values, column: Array) -> None:
        """Keep a column of the sensitivities; probe: the finite change it is for, None for a derivative."""
        if self.model.costly and name not in self.local_names:
            places = FITTED_PLACES if probe is None else PLACES
            kept = self._slopes.setdefault((name, probe), deque(maxlen=places))
            kept.append((self._scaled(values), column))

    def forget_derivatives(self) -> None:
        """Have the next fit begin with derivatives of its own place."""
        self._slopes = {key: kept for key, kept in self._slopes.items() if key[1] is not None}

    def _scaled(self, values: Values) -> Array:
        """Shared parameters in typical changes."""
        shared = np.array([values.shared[name] for name in self._shared])
        return np.asarray(shared / self._typical, float)

    def _predicted(self, values: Values, extra: Sequence[Mapping[str, Array]] | None = None) -> Array:
        rows = np.empty(self.measured.size)
        seen = self._all_outputs(values, extra)
        for block, place in zip(self.blocks, self._places, strict=True):
            outputs = np.stack([seen[block.window][name] for name in block.channels])
            rows[block.start : block.stop] = place.of(outputs).T.ravel()
        return rows

    def motions(self, windows: Sequence[Window], values: Values) -> Sequence[Mapping[str, Array]]:
        """What the model says of every window, no sensor being faulty; windows: those of the problem, maybe with fewer signals."""
        together = getattr(self.model.simulate, "together", None)
        if self.local_names or values.spells or together is None:
            return [self.model.simulate(window, values.in_window(i), {}) for i, window in enumerate(windows)]
        return list(together(windows, values.shared))

    def _all_outputs(
        self, values: Values, extra: Sequence[Mapping[str, Array]] | None
    ) -> list[dict[str, Array]]:
        if extra:
            return [self.outputs(i, values, extra[i]) for i in range(len(self.windows))]
        motions = self.motions(self.windows, values)
        return [self._sensed(i, true, values.in_window(i)) for i, true in enumerate(motions)]
