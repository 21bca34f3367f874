"""The noise of a problem: an autoregression per group of channels, what initial states may do, and what is set aside.

A whitened residual is the error of a one-step predictor, so feedback through a driver or controller does not make noise look like
physics (Ljung, System Identification, 2nd ed., section 8.4). The filter starts again after a gap.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from discrepancy.estimation.autoregression import Whitener, autoregression
from discrepancy.estimation.problem import Problem
from discrepancy.estimation.set_aside import (
    Mask,
    OddInterval,
    after,
    intervals,
    too_early,
    unexplained_steps,
    without_echoes,
    wrong_readings,
)
from discrepancy.model.windows import Block
from discrepancy.signals.recording import Array


class Noise:
    """Whitening of all rows of a problem; `keep` are the raw rows that remain.

    initial_uncertainty: raw rows (N, k) of one standard deviation of each initial state that is nearly known (Parameter.scope); what those
    states may do in each window is part of the noise.
    set_aside: for each block the rows (n,) that nothing explains; they, and rows whose prediction uses them, are not kept.
    """

    def __init__(
        self,
        problem: Problem,
        whiteners: Sequence[Whitener],
        initial_uncertainty: Array | None = None,
        set_aside: Sequence[Mask] = (),
    ) -> None:
        self.whiteners = tuple(whiteners)
        self.initial_uncertainty = (
            np.zeros((problem.measured.size, 0)) if initial_uncertainty is None else initial_uncertainty
        )
        self._blocks = problem.blocks
        self.set_aside = tuple(set_aside)
        self.keep: NDArray[np.intp] = np.concatenate([np.arange(b.start, b.stop) for b in self._blocks])
        self._chosen = self._not_set_aside() if self.set_aside else None
        if self._chosen is not None:
            self.keep = self.keep[self._chosen]
        self.row_window = problem.row_window[self.keep]
        self.row_channel = problem.row_channel[self.keep]
        self.row_time = problem.row_time[self.keep]
        self._windows = problem.row_window
        self.window_count = len(problem.windows)
        self._unsure = [*self._decomposed()]

    def having(self, problem: Problem, initial_uncertainty: Array) -> "Noise":
        """The same noise with another initial-state uncertainty."""
        return Noise(problem, self.whiteners, initial_uncertainty, self.set_aside)

    def on(self, other: Problem, initial_uncertainty: Array | None = None) -> "Noise":
        """The same noise on other recordings, of the same channels or fewer.

        Channels that share their stamps here but not there are known by the size of their residual alone, without its memory.
        """
        known = {block.channels: self.whiteners[block.group] for block in self._blocks}
        sizes = {
            channel: float(size)
            for channels, whitener in known.items()
            for channel, size in zip(
                channels, whitener.innovation_sd if whitener.size is None else whitener.size, strict=True
            )
        }
        whiteners = []
        for blocks in by_group(other.blocks):
            channels = blocks[0].channels
            if channels in known:
                whiteners.append(known[channels])
            else:
                scale = np.diag([1.0 / sizes[channel] for channel in channels])
                whiteners.append(Whitener(np.zeros((0, len(channels), len(channels))), scale))
        return Noise(other, whiteners, initial_uncertainty)

    @property
    def sound(self) -> Mask:
        """Which raw rows (N,) are not set aside."""
        found = np.ones(self._windows.size, bool)
        for block, out in zip(self._blocks, self.set_aside, strict=False):
            found[block.start : block.stop] = np.repeat(~out, block.shape[1])
        return found

    def kept(self, rows: Array) -> Array:
        """Of whitened rows, those that are not set aside."""
        return rows if self._chosen is None else rows[self._chosen]

    def _not_set_aside(self) -> Mask:
        """Which rows are kept."""
        parts = []
        for block, out in zip(self._blocks, self.set_aside, strict=True):
            order = self.whiteners[block.group].order
            parts.append(np.repeat(~after(out, order), block.shape[1]))
        return np.concatenate(parts)

    def errors(self, rows: Array) -> list[Array]:
        """Raw rows (N,) -> whitened one-step errors of every block (n, c), those set aside too."""
        return [
            self.whiteners[block.group].whiten(rows[block.start : block.stop].reshape(*block.shape, 1))[
                ..., 0
            ]
            for block in self._blocks
        ]

    def _decomposed(self) -> Iterator[tuple[slice, Array, Array, Array]]:
        """For each window: its whitened rows, and the singular vectors and values of what its initial states may do there."""
        if not self.initial_uncertainty.size:
            return
        white = self._predicted(self.initial_uncertainty)
        edges = np.flatnonzero(np.diff(self.row_window, prepend=-1, append=-1))
        for first, last in pairwise(edges.tolist()):
            U, size, V = np.linalg.svd(white[first:last], full_matrices=False)
            yield slice(first, last), U, size, V

    def whiten(self, rows: Array) -> Array:
        """Raw rows (N,) or (N, k) -> whitened rows (n,) or (n, k)."""
        white = self._predicted(rows)
        for part, U, size, _ in self._unsure:
            # The covariance of these rows is I + U size² U'. Its inverse square root scales direction U_i by 1 / sqrt(1 + size_i²),
            # so no (n, n) matrix is built.
            shrunk = 1.0 - 1.0 / np.hypot(1.0, size)
            white[part] -= (U * shrunk) @ (U.T @ white[part])
        return white

    def initial_part(self, rows: Array) -> tuple[Array, float]:
        """Of raw rows (N,): the part that most likely stems from initial states, and how many parameters that part is worth."""
        white, found, used = self._predicted(rows), np.zeros(rows.size), 0.0
        for part, U, size, V in self._unsure:
            likely = V.T @ (size / (1.0 + size**2) * (U.T @ white[part]))
            own = self._windows == self.row_window[part.start]
            found[own] = self.initial_uncertainty[own] @ likely
            used += float(np.sum(size**2 / (1.0 + size**2)))
        return found, used

    def log_density(self) -> float:
        """Logarithm of the density of raw rows that are whitened to nothing, but for a constant."""
        out = [int(rows.sum()) for rows in self.set_aside] or [0] * len(self._blocks)
        # the first rows of a block count as the others do, or noises of different order could not be compared
        known = sum(
            (block.shape[0] - gone) * float(np.linalg.slogdet(self.whiteners[block.group].inverse_factor)[1])
            for block, gone in zip(self._blocks, out, strict=True)
        )
        return known - 0.5 * sum(float(np.sum(np.log1p(size**2))) for _, _, size, _ in self._unsure)

    def _predicted(self, rows: Array) -> Array:
        """Errors of one-step predictions, white but for what initial states do."""
        columns = rows[:, None] if rows.ndim == 1 else rows
        parts = []
        for block in self._blocks:
            whitener, (n, c), k = self.whiteners[block.group], block.shape, columns.shape[1]
            parts.append(
                whitener.whiten(columns[block.start : block.stop].reshape(n, c, k)).reshape(n * c, k)
            )
        white = np.concatenate(parts)
        white = self.kept(white)
        return white[:, 0] if rows.ndim == 1 else white

    def innovation_sd(self, problem: Problem) -> dict[str, float]:
        """One-step error per channel, in the channel's unit."""
        return {
            name: float(sd)
            for block in problem.blocks
            for name, sd in zip(block.channels, self.whiteners[block.group].innovation_sd, strict=True)
        }


def white_noise(
    problem: Problem,
    residual: Array,
    initial_uncertainty: Array | None = None,
    set_aside: Sequence[Mask] = (),
) -> Noise:
    """No memory yet: each channel scaled by the spread of its residual; the other arguments: of `Noise`."""
    whiteners = []
    for blocks, out in _grouped(problem, set_aside):
        spread = np.std(_stack(blocks, residual)[~np.concatenate(out)], axis=0)
        size = np.maximum(spread, 1e-9 * (1.0 + np.abs(np.mean(_stack(blocks, problem.measured), axis=0))))
        size = np.maximum(size, _floors(problem, blocks))
        c = blocks[0].shape[1]
        whiteners.append(Whitener(np.zeros((0, c, c)), np.diag(1.0 / size)))
    return Noise(problem, whiteners, initial_uncertainty, set_aside)


def estimate_noise(problem: Problem, residual: Array, used: float, known: Noise | None = None) -> Noise:
    """Autoregression of the residual rows; `used` parameters were fitted to them (their share of freedom is given back).

    known: the noise as it was taken to be, by which the part of the rows that is due to initial states is taken out; rows that it sets aside
    stay so.
    """
    set_aside = known.set_aside if known is not None else ()
    if known is not None:
        initial, also = known.initial_part(residual)
        residual, used = residual - initial, used + also
    # fitted parameters make residuals too small; at most a factor of four is given back, for recordings with few rows
    freedom_correction = residual.size / max(residual.size - used, 0.25 * residual.size)
    return Noise(
        problem,
        [
            autoregression(blocks, residual, freedom_correction, _floors(problem, blocks), out)
            for blocks, out in _grouped(problem, set_aside)
        ],
        known.initial_uncertainty if known is not None else None,
        set_aside,
    )


def setting_aside(
    problem: Problem,
    residual: Array,
    used: float,
    known: Noise,
    raw: Array,
    spared: set[int],
    *,
    with_intervals: bool = True,
) -> Noise:
    """The noise without rows that nothing explains; arguments as of `estimate_noise`.

    raw: the residual with what candidates could explain; spared: groups of which too much would go, and which keep their rows;
    with_intervals: intervals of time too, not only outliers.
    """
    noise = estimate_noise(problem, residual, used, known)
    out = _marked(problem, noise, residual - known.initial_part(residual)[0], raw, spared, with_intervals)
    if not any(rows.any() for rows in out):
        return Noise(problem, noise.whiteners, known.initial_uncertainty)
    return estimate_noise(
        problem, residual, used, Noise(problem, noise.whiteners, known.initial_uncertainty, out)
    )


def restored(
    problem: Problem, residual: Array, used: float, noise: Noise, *, with_intervals: bool = True
) -> Noise:
    """The noise with rows back in that were only predicted from an outlier; arguments as of `setting_aside`."""
    out = list(noise.set_aside)
    for at in _by_group(problem):
        own = [residual[r.start : r.stop].reshape(r.shape) for r in (problem.blocks[i] for i in at)]
        kept = without_echoes(own, [out[i] for i in at])
        for i, rows in zip(at, kept if with_intervals else wrong_readings(own, kept), strict=True):
            out[i] = rows
    return estimate_noise(
        problem, residual, used, Noise(problem, noise.whiteners, noise.initial_uncertainty, out)
    )


def what_is_aside(problem: Problem, residual: Array, noise: Noise) -> list[OddInterval]:
    """The rows that a noise sets aside, as intervals of time in order; residual: raw rows (N,)."""
    if not noise.set_aside:
        return []
    errors, found = noise.errors(residual), []
    for at in _by_group(problem):
        own = [problem.blocks[i] for i in at]
        found += intervals(own, [errors[i] for i in at], [noise.set_aside[i] for i in at])
    return sorted(found, key=lambda s: (s.window, s.start_s))


def _marked(
    problem: Problem, noise: Noise, left: Array, raw: Array, spared: set[int], with_intervals: bool
) -> tuple[Mask, ...]:
    """Rows of every block that nothing explains; groups of which too much would go keep all of theirs, and join the spared ones."""
    errors, before = noise.errors(left), noise.errors(raw)
    out = list(noise.set_aside) or [np.zeros(block.shape[0], bool) for block in problem.blocks]
    for group, at in enumerate(_by_group(problem)):
        own, was, known = [errors[i] for i in at], [before[i] for i in at], [out[i] for i in at]
        marked = (
            None if group in spared else unexplained_steps(own, was, known, with_intervals=with_intervals)
        )
        if marked is None:
            spared.add(group)
        else:
            rows = [left[b.start : b.stop].reshape(b.shape) for b in (problem.blocks[i] for i in at)]
            early = too_early(rows, noise.whiteners[group].order)
            marked = [found | first for found, first in zip(marked, early, strict=True)]
        for i, k in enumerate(at):
            out[k] = np.zeros_like(out[k]) if marked is None else marked[i]
    return tuple(out)


def _by_group(problem: Problem) -> list[list[int]]:
    """Numbers of the blocks of each group."""
    count = 1 + max(block.group for block in problem.blocks)
    return [[i for i, block in enumerate(problem.blocks) if block.group == group] for group in range(count)]


def _grouped(problem: Problem, set_aside: Sequence[Mask]) -> Iterator[tuple[list[Block], list[Mask]]]:
    """Runs by group, each with the rows of it that are set aside."""
    out = set_aside or [np.zeros(block.shape[0], bool) for block in problem.blocks]
    for at in _by_group(problem):
        yield [problem.blocks[i] for i in at], [out[i] for i in at]


def _floors(problem: Problem, blocks: Sequence[Block]) -> Array:
    """What the model says its one-step errors are at least, for the channels of a group."""
    return np.array([problem.model.floors.get(name, 0.0) for name in blocks[0].channels])


def by_group(blocks: Sequence[Block]) -> list[list[Block]]:
    count = 1 + max(block.group for block in blocks)
    return [[block for block in blocks if block.group == g] for g in range(count)]


def _stack(blocks: Sequence[Block], rows: Array) -> Array:
    return np.concatenate([rows[block.start : block.stop].reshape(block.shape) for block in blocks])
