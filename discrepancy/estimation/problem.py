"""The estimation problem: recordings cut into windows for one model, and all measured and predicted values as one column of rows.

Rows are ordered by window, then by group of channels that share their stamps, then by block of samples without gaps, then by time. The
rows of a window are therefore contiguous, and its initial states can be projected out by themselves.
"""

import os
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from discrepancy.estimation.effort import Costs
from discrepancy.estimation.jacobian_cache import JacobianCache
from discrepancy.estimation.jumps import Commands, Held, a_step_late, jumping
from discrepancy.model.description import Model, Parameter, Window
from discrepancy.model.failure import BadModel
from discrepancy.model.sensors import Shown, gain, shown, through_sensors
from discrepancy.model.windows import (
    FEWEST_SAMPLES,
    OUTPUTS,
    Block,
    Place,
    cut,
    means_of,
    odd_stamps,
    sample_blocks,
    samples_per_row,
    usable,
)
from discrepancy.signals.recording import Array, Complaint, Recording, cleaned, longest

Mask = NDArray[np.bool_]
Windows = tuple[int, ...]
"""Numbers of some windows of a problem, in order."""
RECENT = 4  # predictions that are kept, because a fit often starts at a point that the one before has tried
FAR = 1e9  # largest misfit of a prediction, in the largest value of its channel: beyond any wrong unit, so the model has diverged
USED = 0.9  # share of a channel's samples below which it is worth a line that the others are not used


@dataclass(frozen=True, slots=True)
class Values:
    """All values that a prediction depends on, beside the windows themselves."""

    shared: Mapping[str, float]  # parameters of all windows
    local: Mapping[str, Array]  # parameters of single windows, one value each (windows,)
    active_intervals: Mapping[str, Windows] = field(
        default_factory=dict
    )  # windows outside which a shared one is `off`
    off: Mapping[str, float] = field(default_factory=dict)  # values of those parameters in all other windows
    warm_up: Mapping[str, float] = field(default_factory=dict)  # of Window, for models that warm up

    def having(self, **changes: float) -> "Values":
        """A copy with some shared values changed."""
        return self.with_shared(changes)

    def with_shared(self, changes: Mapping[str, float]) -> "Values":
        """The same, by mapping: names of parameters may hold dots."""
        return replace(self, shared={**self.shared, **changes})

    def active_in(self, parameters: Iterable[Parameter], windows: Windows) -> "Values":
        """A copy in which these parameters have their values in some windows only, and are off in the others."""
        names = {p.name: p.value for p in parameters}
        return replace(
            self,
            active_intervals={**self.active_intervals, **dict.fromkeys(names, windows)},
            off={**self.off, **names},
        )

    def warmed_up_as(self, other: "Values") -> "Values":
        """A copy with the warm-up values of another."""
        return replace(self, warm_up=other.warm_up)

    def starting_as(self, states: Mapping[str, Array]) -> "Values":
        """A copy with these initial states (windows,) by name."""
        return replace(self, local={**self.local, **states})

    def same(self, other: "Values") -> bool:
        """Whether every model predicts the same for both."""
        mine = (self.shared, self.active_intervals, self.off, self.warm_up)
        theirs = (other.shared, other.active_intervals, other.off, other.warm_up)
        return mine == theirs and all(
            np.array_equal(values, other.local[name]) for name, values in self.local.items()
        )

    def in_window(self, index: int) -> dict[str, float]:
        """All parameters by name as one window has them."""
        resting = {
            name: self.off[name] for name, windows in self.active_intervals.items() if index not in windows
        }
        local = {name: float(values[index]) for name, values in self.local.items()}
        return {**self.shared, **resting, **local}


class Unusable(ValueError):
    """These recordings allow no conclusion with this model; the fatal complaints give the reasons."""

    def __init__(self, complaints: Sequence[Complaint]) -> None:
        self.reasons = [c.described for c in complaints if c.fatal] or ["no recordings were given"]
        super().__init__("; ".join(self.reasons))
        self.complaints = tuple(complaints)


@dataclass(slots=True)
class _Count:
    """Simulations so far, of a problem and all its copies."""

    simulations: int = 0


class Problem:
    """One model on some recordings.

    A prediction depends on its arguments alone. What is kept (recent predictions, Jacobian columns of expensive models) saves
    simulations; a column that is reused from a nearby point changes how a fit proceeds, never what is predicted.

    row_period_s: time between rows of channels that come faster; finer: steps of the grid in one of the model's, with the same windows and rows.
    edges: by recording, times at which windows are cut beside their own ends [s].
    """

    def __init__(
        self,
        model: Model,
        recordings: Sequence[Recording],
        row_period_s: Mapping[tuple[str, ...], float] | None = None,
        finer: int = 1,
        edges: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        self.model = model.in_recordings_of(longest(recordings))
        self.edges = dict(edges or {})
        self.recordings = tuple(recordings)
        # the same filter for recorded and predicted samples: a mean over neighbours biases nothing
        self.row_period_s = dict(row_period_s or {})
        self.costs = Costs(model.costly)
        self.windows: list[Window] = []
        self.blocks: list[Block] = []
        complaints: list[Complaint] = []
        self._groups: dict[tuple[str, ...], int] = {}
        self._shown: dict[str, Shown] = {}
        self._held: dict[str, Held] = {}
        measured: list[Array] = []
        rows = 0
        for recording in recordings:
            clean, damage = cleaned(recording)
            complaints += damage
            found = usable(model, clean, complaints)
            if found is None:
                continue
            outputs, interval = found
            self._shown[clean.name] = shown(clean.signals, outputs)
            self._held[clean.name] = {
                n: clean.signals[n] for n in model.held if n in model.driving and n in clean.signals
            }
            before = len(self.windows)
            scored: list[tuple[float, float]] = []
            for window in cut(model, clean, interval, finer, self.edges.get(clean.name, ())):
                scored.append((window.start_s, window.end_s))
                index = len(self.windows)
                parts = list(sample_blocks(window, {name: clean.signals[name] for name in outputs}))
                if not parts:
                    continue
                self.windows.append(window)
                for channels, time_s, values in parts:
                    group = self._groups.setdefault(channels, len(self._groups))
                    each = samples_per_row(time_s, self.row_period_s.get(channels, 0.0))
                    whole = time_s.size - time_s.size % each
                    stamps, means = means_of(time_s[:whole], each), means_of(values[:whole].T, each).T
                    self.blocks.append(Block(index, group, channels, stamps, rows, time_s[:whole], each))
                    measured.append(means.ravel())
                    rows += means.size
            complaints += _left_out(clean, scored, self.blocks, range(before, len(self.windows)))
            if len(self.windows) == before:
                low, high = interval
                text = (
                    f"have no {FEWEST_SAMPLES} samples in a row from {low:.6g} to {high:.6g} s, where all inputs exist"
                    f"{odd_stamps(model, clean.signals[outputs[0]])}"
                )
                complaints.append(Complaint(recording.name, OUTPUTS, text, fatal=True))
        if not self.windows:
            raise Unusable(complaints)
        self.complaints = tuple(complaints)
        self.measured = np.concatenate(measured)
        self.channels = tuple(dict.fromkeys(name for block in self.blocks for name in block.channels))
        self.missing = tuple(name for name in model.outputs if name not in self.channels)
        self.row_window, self.row_channel, self.row_time = self._labels()
        self._reach = self._reaches()
        # parameter, the readings that it delays together, and the recording in which it does; None: all
        self._common_delays = [
            *((c.parameter, c.channels, c.recording) for c in model.clocks),
            *((e.parameters[0].name, e.readings, None) for e in model.effects if e.readings),
        ]
        self.local_names = tuple(p.name for p in model.nuisances if p.scope == "window")
        self.initial_uncertainty_names = tuple(
            p.name for p in model.nuisances if p.scope == "initial_uncertainty"
        )
        self.nuisance_names = tuple(p.name for p in model.nuisances if p.scope == "all")
        self.jacobian = JacobianCache(
            [p for p in model.parameters if p.scope != "window"], model.jacobian_reach
        )
        self._count = _Count()
        self._recent: deque[tuple[Values, Array]] = deque(maxlen=RECENT)
        self._places = [Place.on(self.windows[block.window].time_s, block.sample_s) for block in self.blocks]

    @property
    def simulations(self) -> int:
        """Calls of predict so far, the unit of cost; those of copies count too."""
        return self._count.simulations

    @property
    def samples(self) -> int:
        """Recorded samples of all channels, before any were averaged."""
        return sum(block.sample_s.size * len(block.channels) for block in self.blocks)

    def again(
        self,
        *,
        model: Model | None = None,
        row_period_s: Mapping[tuple[str, ...], float] | None = None,
        finer: int = 1,
        edges: Mapping[str, Sequence[float]] | None = None,
    ) -> "Problem":
        """The same recordings, averaged and cut in the same way where nothing else is given; edges: further ones."""
        further = edges or {}
        both = {n: (*self.edges.get(n, ()), *further.get(n, ())) for n in {*self.edges, *further}}
        rows = self.row_period_s if row_period_s is None else row_period_s
        return Problem(model or self.model, self.recordings, rows, finer, both)

    def measuring(self, values: Values) -> "Problem":
        """A copy whose measured rows are the model's prediction at these values, without noise; it shares the cached Jacobian columns."""
        other = copy(self)
        other.measured = self.predict(values)
        return other

    def trusting_less(self, names: Collection[str], factor: float) -> "Problem":
        """A copy in which the priors of these nuisances are wider by a factor; it shares the cached Jacobian columns."""
        other = copy(self)
        other.model = replace(
            self.model,
            nuisances=tuple(
                replace(p, prior_sd=factor * p.prior_sd) if p.name in names and p.prior_sd is not None else p
                for p in self.model.nuisances
            ),
        )
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

    def _reaches(self) -> Array:
        """How far a prediction may lie from each measured row (N,)."""
        of = [self.measured[self.row_channel == i] for i in range(len(self.channels))]
        sizes = np.array([np.max(np.abs(values)) for values in of])
        return np.asarray(FAR * np.where(sizes > 0.0, sizes, 1.0)[self.row_channel], float)

    @cached_property
    def guesses(self) -> dict[str, Array]:
        """Initial states of every window (windows,) as the model guesses them from the recording."""
        return {
            p.name: np.array([self._guess(p, w) for w in self.windows])
            for p in self.model.nuisances
            if p.scope == "window"
        }

    def _guess(self, parameter: Parameter, window: Window) -> float:
        """The guess of an initial state. Raises BadModel."""
        if parameter.guess is None:
            return parameter.value
        try:
            return parameter.guess(window)
        except Exception as error:
            raise BadModel.failing(self.model, error, parameter) from error

    def start(self) -> Values:
        """The baseline: every effect off, initial states at their guess."""
        shared = {p.name: p.value for p in self.model.parameters if p.scope != "window"}
        return Values(shared, {name: states.copy() for name, states in self.guesses.items()})

    def warmed_up(self, values: Values, by: Values) -> Values:
        """The values, with warm-up runs at the shared values of `by`, temporary effects off; unchanged for models without warm-up runs."""
        return replace(values, warm_up={**by.shared, **by.off}) if self.model.warms_up else values

    def _sensed(
        self, index: int, true: Mapping[str, Array], parameters: Mapping[str, float]
    ) -> dict[str, Array]:
        """Readings of one window on its grid."""
        window = self.windows[index]
        known = self._with_common_delays(window, parameters)
        return self._read(window, true, known, self._shown[window.recording])

    def _with_common_delays(self, window: Window, parameters: Mapping[str, float]) -> dict[str, float]:
        """The parameters, with delays of devices and clocks in those of their readings."""
        known = dict(parameters)
        for delay, channels, recording in self._common_delays:
            if known[delay] and recording in (None, window.recording):
                for name in channels:
                    known[f"{name}.delay"] = known.get(f"{name}.delay", 0.0) + known[delay]
        return known

    def _read(
        self, window: Window, true: Mapping[str, Array], parameters: Mapping[str, float], shown: Shown
    ) -> dict[str, Array]:
        """Readings of sensors with these faults, on the grid of a window."""
        since_s, lags = self.windows[0].start_s, self.model.lags
        return through_sensors(true, parameters, window.time_s, window.step_s, since_s, lags, shown)

    @cached_property
    def _jumping(self) -> frozenset[str]:
        """Outputs that follow a held input at once and are read between grid points."""
        # the axes of a misaligned sensor are turned together, and a filtered output does not jump
        turned = {
            name for p in self.model.parameters for name in p.name.split(".turn.") if ".turn." in p.name
        }
        between = {
            name
            for block, place in zip(self.blocks, self._places, strict=True)
            if place.part is not None
            for name in block.channels
        }
        between -= {*self.model.lags, *turned}
        held = [name for name in self.model.held if name in self.model.driving]
        if self.model.costly or not between or not held:
            return frozenset()
        start = self.start()

        def simulated(index: int, window: Window) -> Mapping[str, Array]:
            return self._simulated(window, start.in_window(index), {})

        return jumping(held, self.windows, between, simulated)

    @cached_property
    def _commands(self) -> list[dict[str, Commands]]:
        """What each output that jumps follows, in every window."""
        found, start = [], self.start()
        for i, window in enumerate(self.windows):
            held = {n: s for n, s in self._held[window.recording].items() if window.has(n)}
            values = start.in_window(i)
            as_given = self._simulated(window, values, {})
            late = {n: self._simulated(a_step_late(window, n), values, {}) for n in held}
            found.append(
                {
                    output: Commands.of(window, held, {n: as_given[output] - late[n][output] for n in held})
                    for output in self._jumping
                }
            )
        return found

    @cached_property
    def _commands_at_rows(self) -> dict[tuple[int, str], Callable[[float, float], Array]]:
        """The commands at the samples of every block that has an output which jumps, by its number and the output; of a delay and a lag."""
        return {
            (i, name): self._commands[block.window][name].reading(block.sample_s)
            for i, block in enumerate(self.blocks)
            for name in block.channels
            if name in self._jumping
        }

    def predict(self, values: Values, extra: Sequence[Mapping[str, Array]] | None = None) -> Array:
        """Predicted rows (N,), read-only because they are kept; extra: by window, signals that are added at the model's ports."""
        if extra is not None:
            self._count.simulations += 1
            return self._within_reach(self._predicted(values, extra))
        for known, rows in self._recent:
            if known.same(values):
                return rows
        self._count.simulations += 1
        rows = self._within_reach(self._predicted(values))
        rows.flags.writeable = False
        self._recent.appendleft((values, rows))
        return rows

    def diverged(self, rows: Array) -> Mask:
        """Rows (N,) of a prediction at which the model has diverged."""
        return np.asarray(np.abs(rows - self.measured) > 0.999 * self._reach, bool)

    def predict_each(self, points: Sequence[Values]) -> list[Array]:
        """Predicted rows at many points, in parallel if the model allows it."""
        self._count.simulations += len(points)
        if not self.model.threads or len(points) < 2:
            return [self._within_reach(self._predicted(values)) for values in points]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return [self._within_reach(rows) for rows in pool.map(self._predicted, points)]

    def _predicted(self, values: Values, extra: Sequence[Mapping[str, Array]] | None = None) -> Array:
        rows = np.empty(self.measured.size)
        # A model that diverges at some values overflows; that is no fault of its code, and no value of a warning.
        with np.errstate(over="ignore", invalid="ignore"):
            motions = self._motions(values, extra)
            seen = [self._sensed(i, true, values.in_window(i)) for i, true in enumerate(motions)]
            for block, place in zip(self.blocks, self._places, strict=True):
                outputs = np.stack([seen[block.window][name] for name in block.channels])
                rows[block.start : block.stop] = means_of(place.of(outputs), block.averaged).T.ravel()
            if self._jumping:
                self._put_jumping(rows, motions, values)
        return rows

    def _put_jumping(self, rows: Array, motions: Sequence[Mapping[str, Array]], values: Values) -> None:
        """Rows of outputs that jump, in the place of those on a straight line between grid points."""
        # faults of sensors are linear, so that they act on both parts of such an output; only the bias is of one
        for (number, name), commands_behind in self._commands_at_rows.items():
            block, place = self.blocks[number], self._places[number]
            window, commands = self.windows[block.window], self._commands[block.window][name]
            parameters = self._with_common_delays(window, values.in_window(block.window))
            smooth, gains = commands.split(motions[block.window][name])
            seen = self._read(window, {name: smooth}, parameters, {})[name]
            late, lag = parameters.get(f"{name}.delay", 0.0), parameters.get(f"{name}.lag", 0.0)
            at_once = gain(name, parameters) * (commands_behind(late, lag) @ gains)
            read = means_of(place.of(seen) + at_once, block.averaged)
            rows[block.start + block.channels.index(name) : block.stop : len(block.channels)] = read

    def _within_reach(self, rows: Array) -> Array:
        """The rows, each at most FAR times the largest value of its channel from what was measured.

        A search tries values at which a model diverges. They have to lose against others by their misfit, and sums of their
        squares have to stay numbers.
        """
        off = rows - self.measured
        if (np.abs(off) <= self._reach).all():  # false for what is not a number
            return rows
        off = np.clip(np.nan_to_num(off, nan=np.inf), -self._reach, self._reach)
        return np.asarray(self.measured + off, float)

    def motions(self, windows: Sequence[Window], values: Values) -> Sequence[Mapping[str, Array]]:
        """True outputs of every window, before sensor faults; windows: those of the problem, possibly with fewer signals."""
        together = getattr(self.model.simulate, "together", None)
        warmed = [_warmed(window, values) for window in windows]
        if self.local_names or values.active_intervals or together is None:
            return [self._simulated(w, values.in_window(i), {}) for i, w in enumerate(warmed)]
        try:
            return list(together(warmed, values.shared))
        except OverflowError:
            return [self._diverged(window) for window in warmed]
        except Exception as error:
            raise BadModel.failing(self.model, error) from error

    def _simulated(
        self, window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        """One window; not a number where Python's floats overflow at these values, which is a model that diverges. Raises BadModel."""
        try:
            return self.model.simulate(window, values, extra)
        except OverflowError:
            return self._diverged(window)
        except Exception as error:
            raise BadModel.failing(self.model, error) from error

    def _diverged(self, window: Window) -> dict[str, Array]:
        return {name: np.full(window.time_s.size, np.nan) for name in self.model.outputs}

    def all_outputs(
        self, values: Values, extra: Sequence[Mapping[str, Array]] | None = None
    ) -> list[dict[str, Array]]:
        """Sensor outputs on the grid of every window, recorded or not; extra: as of `predict`."""
        motions = self._motions(values, extra)
        return [self._sensed(i, true, values.in_window(i)) for i, true in enumerate(motions)]

    def _motions(
        self, values: Values, extra: Sequence[Mapping[str, Array]] | None
    ) -> Sequence[Mapping[str, Array]]:
        """True outputs of every window; extra: as of `predict`."""
        if not extra:
            return self.motions(self.windows, values)
        windows = [_warmed(window, values) for window in self.windows]
        return [self._simulated(w, values.in_window(i), extra[i]) for i, w in enumerate(windows)]


def _left_out(
    recording: Recording, scored: Sequence[tuple[float, float]], blocks: Sequence[Block], windows: range
) -> Iterator[Complaint]:
    """A complaint for each channel of which much is not used, because it lies in blocks that are too short.

    scored: from when to when; a model's lead-in, and what its segments leave out, is no loss.
    """
    blocks = [block for block in blocks if block.window in windows]
    for name in dict.fromkeys(name for block in blocks for name in block.channels):
        time_s = recording.signals[name].time_s
        there = int(np.count_nonzero(np.any([(time_s >= a) & (time_s <= b) for a, b in scored], axis=0)))
        used = sum(block.sample_s.size for block in blocks if name in block.channels)
        if used < USED * there:
            text = f"{there - used} of {there} samples are not used: gaps leave fewer than {FEWEST_SAMPLES} of them in a row"
            yield Complaint(recording.name, name, text)


def _warmed(window: Window, values: Values) -> Window:
    return replace(window, warm_up=values.warm_up) if values.warm_up else window
