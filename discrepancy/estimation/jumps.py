"""Outputs that jump with a command: a voltage with a current, an acceleration with a thrust.

Between grid points an output is read on a straight line. One that follows a held input at once would rise for a whole step instead of jumping, and its sensor
would seem early or late. Here it is split into a part that is continuous and one that is the command's own, which is known at any time.

How an output follows may change from one jump to the next: a brake decelerates only what moves. So it is measured at every jump, at the baseline's values: each input
in turn comes a step late, and what is missing at a jump is what that jump does at once.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.linalg.lapack import dtbtrs

from discrepancy.model.description import Window
from discrepancy.signals.recording import Array, Signal
from discrepancy.signals.resampling import resampled

ROUNDING: Final = 1e-9  # of the largest singular value, below which a direction is left out
FORGOTTEN: Final = 20.0  # time constants after which a lag has forgotten, to 2e-9
WINDOWS_BEFORE: Final = 10.0  # and no less than so many seconds, for which a lag may look back
SECONDS_BEFORE: Final = 60.0
JUMPS: Final = 1e-3  # of an output's spread: a smaller jump is none
LAST: Final = 1e-3  # weight of inputs in jumps beside the inputs themselves
SEEN: Final = 1e-3  # of the largest jump of an input in a window, or of a jump's share in a step: at a smaller one no response is measured
Held = Mapping[str, Signal]
"""Held inputs of a recording by name."""


def jumping(
    inputs: Collection[str],
    windows: Sequence[Window],
    outputs: Collection[str],
    simulated: Callable[[int, Window], Mapping[str, Array]],
) -> frozenset[str]:
    """The outputs that jump where one of these held inputs does. simulated: by number of a window and the window.

    A single value of the input is changed, by its largest jump; what changes at the same grid point follows it at once.
    """
    found = set[str]()
    for name in inputs:
        sizes = [np.max(np.abs(np.diff(w[name])), initial=0.0) if w.has(name) else 0.0 for w in windows]
        i = int(np.argmax(sizes))
        if sizes[i] == 0.0:
            continue
        window, at = windows[i], int(np.argmax(np.abs(np.diff(windows[i][name])))) + 1
        changed = window[name].copy()
        changed[at] = changed[at - 1]
        before = simulated(i, window)
        after = simulated(i, replace(window, known={**window.known, name: changed}))
        found |= {
            output
            for output in outputs
            if abs(after[output][at] - before[output][at]) > JUMPS * np.std(before[output])
        }
    return frozenset(found)


def a_step_late(window: Window, name: str) -> Window:
    """The window in which one held input comes a step of the grid late."""
    values = window[name]
    return replace(window, known={**window.known, name: np.concatenate([values[:1], values[:-1]])})


def in_jumps(source: Signal, window: Window, held: Array, response: Array) -> Signal:
    """A held input, each of its jumps as large as what it does to an output at once.

    held: the input on the grid (n,); response: the output less what it is with the input a step late (n,). Jumps before and after the window, which only a
    lag shows, do what those in it do.
    """
    change = np.diff(held, prepend=held[0])
    seen = np.abs(change) > SEEN * np.max(np.abs(change), initial=0.0)
    per_unit = np.divide(response, change, out=np.zeros(held.size), where=seen)
    usual = float(np.median(per_unit[seen])) if seen.any() else 0.0
    jumps = np.diff(source.value, prepend=source.value[0])
    # a jump within a step is in the means of two steps, by its shares of the first
    place = (source.time_s - window.time_s[0]) / window.step_s
    step = np.floor(place + ROUNDING * np.maximum(np.abs(place), 1.0)).astype(np.intp)
    later = np.clip(place - step, 0.0, 1.0)
    does, weight = np.zeros(jumps.size), np.zeros(jumps.size)
    for at, share in ((step, 1.0 - later), (step + 1, later)):
        within = (at >= 0) & (at < held.size)
        there = np.clip(at, 0, held.size - 1)
        share = np.where(within & seen[there], share, 0.0)
        does, weight = does + share * per_unit[there], weight + share
    known = weight > SEEN
    does = np.where(known, does / np.where(known, weight, 1.0), usual)
    return replace(source, value=np.cumsum(jumps * does))


def _near(source: Signal, window: Window) -> Signal:
    """The part of an input that a window and a lag in it may see: of an hour, every window would keep all."""
    start, end = float(window.time_s[0]), float(window.time_s[-1])
    before = start - max(WINDOWS_BEFORE * (end - start), SECONDS_BEFORE)
    first = max(int(np.searchsorted(source.time_s, before, side="right")) - 1, 0)
    stop = max(int(np.searchsorted(source.time_s, end + window.step_s, side="right")), first + 1)
    return replace(source, time_s=source.time_s[first:stop], value=source.value[first:stop])


@dataclass(frozen=True, slots=True)
class Command:
    """A held input as it was recorded, and what an output may follow of it: itself, its square, and it in jumps."""

    stamps: Array  # (s,)
    values: Array  # (s, c)


@dataclass(frozen=True, slots=True)
class Commands:
    """What one output follows in one window: the columns of each held input, on the model's grid and as they were recorded."""

    grid: Array  # (n, k)
    recorded: Sequence[Command]  # their columns one after the other (k)
    # least squares over the steps, but for the output itself: orthonormal columns (n - 1, r) and what makes gains of them (k, r)
    driven: Array
    back: Array

    @classmethod
    def of(cls, window: Window, held: Held, responses: Mapping[str, Array]) -> "Commands":
        """Those of a window; held: the inputs that its recording has; responses: of the output to each of them, as of `in_jumps`."""
        grid, recorded = [np.empty((window.time_s.size, 0))], []
        for name, whole in held.items():
            source, on_grid = _near(whole, window), window[name]
            own = in_jumps(source, window, on_grid, responses[name])
            grid.append(np.column_stack([on_grid, on_grid**2, resampled(own, window.time_s)]))
            values = np.column_stack([source.value, source.value**2, own.value])
            recorded.append(Command(source.time_s, values))
        # What an output does at once holds some of what it does within a step, too. Where the inputs alone explain the jumps, they are to:
        # of solutions that fit alike the shortest is taken, and of a light column it has next to nothing.
        return cls.made(np.hstack(grid), recorded, np.tile((1.0, 1.0, LAST), len(recorded)))

    @classmethod
    def made(cls, grid: Array, recorded: Sequence[Command], weights: Array | None = None) -> "Commands":
        """With what least squares need beforehand; weights (k,): of solutions that fit alike, one without the lighter columns is preferred."""
        weights = np.ones(grid.shape[1]) if weights is None else weights
        # what changes within a step is the jump of the inputs, and what they, the state and a constant drive
        columns = np.hstack([np.diff(grid, axis=0), grid[:-1], np.ones((len(grid) - 1, 1))])
        size = np.linalg.norm(columns, axis=0)
        size[size == 0.0] = 1.0
        size /= np.concatenate([weights, weights, [1.0]])
        U, s, Vt = np.linalg.svd(columns / size, full_matrices=False)
        sound = s > ROUNDING * s[0]
        back = (Vt[sound].T / s[sound])[: grid.shape[1]] / size[: grid.shape[1], None]
        return cls(grid, recorded, U[:, sound], back)

    def split(self, output: Array) -> tuple[Array, Array]:
        """An output (n,) without what it owes to the commands at once, and how it follows each of them (k,)."""
        gains = self._gains(output)
        return output - self.grid @ gains, gains

    def at(self, time_s: Array, lag_s: float = 0.0) -> Array:
        """The commands at times in order (m, k), behind a first-order lag."""
        found = [np.empty((time_s.size, 0))]
        for command in self.recorded:
            stamps, values = command.stamps, command.values
            last = np.clip(np.searchsorted(stamps, time_s, side="right") - 1, 0, None)
            there = values[last]
            if lag_s > 0.0:
                first = max(int(np.searchsorted(stamps, time_s[0] - FORGOTTEN * lag_s)) - 1, 0)
                upto = slice(first, int(last[-1]) + 1)
                reached = _followed(stamps[upto], values[upto], lag_s)[last - first]
                left = np.exp(-np.maximum(time_s - stamps[last], 0.0) / lag_s)[:, None]
                there = there + left * (reached - there)
            found.append(there)
        return np.hstack(found)

    def reading(self, time_s: Array) -> Callable[[float, float], Array]:
        """The commands at these times in order (m, k), of a delay and of a lag behind it [s].

        Those of the last two pairs are kept: a derivative changes one value at a time, and seldom one of these.
        """

        @lru_cache(maxsize=2)
        def behind(late_s: float, lag_s: float) -> Array:
            return self.at(time_s - late_s, lag_s)

        return behind

    def _gains(self, output: Array) -> Array:
        """How the output follows the inputs at once (k,), by least squares over the steps of the window."""
        if not np.isfinite(output).all():
            return np.zeros(self.grid.shape[1])
        change, state = np.diff(output), output[:-1]
        of_change, of_state = self.driven.T @ change, self.driven.T @ state
        own = state - self.driven @ of_state
        size = float(own @ own)
        by_state = float(own @ change) / size if size > ROUNDING**2 * float(state @ state) else 0.0
        return np.asarray(self.back @ (of_change - by_state * of_state), float)


def _followed(stamps: Array, values: Array, lag_s: float) -> Array:
    """Where a first-order lag behind held inputs is when they change (m, c); in its steady state at the first stamp.

    Each value is a share of the one before and the rest of the input: a triangular system of two bands.
    """
    left = np.exp(-np.diff(stamps) / lag_s)
    bands = np.ones((2, stamps.size))
    bands[1, :-1] = -left
    driven = values.copy()
    driven[1:] = (1.0 - left)[:, None] * values[:-1]
    found, info = dtbtrs(bands, driven, uplo="L", diag="U")
    assert info == 0, info
    return np.asarray(found, float)
