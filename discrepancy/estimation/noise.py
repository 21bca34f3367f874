"""The noise model: a vector autoregression of the residuals per group of channels, and the whitening of rows with it.

A whitened residual is the error of a one-step predictor, which uses the residual's own past. Therefore feedback through a driver or
controller does not make noise look like physics (Ljung, System Identification, 2nd ed., section 8.4). BIC chooses the order. The model
assumes evenly spaced samples: jitter is neglected, and the filter starts again after a gap.

The first rows of a block have too short a past for the autoregression. Left out, they would leave initial states nearly free: beside a
noise with a long memory, states would run far from what was measured and imitate any slow effect in a short window. So together they count
as one row whose standard deviation is five times the size of the residual.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from discrepancy.estimation.problem import Problem
from discrepancy.estimation.set_aside import (
    Mask,
    OddInterval,
    after,
    intervals,
    unexplained_steps,
    without_echoes,
)
from discrepancy.model.windows import Block
from discrepancy.signals.recording import Array

HIGHEST_ORDER = 10
# Standard deviation of the first rows of a block, in sizes of the residual. At 10 initial states run away again; at 1 what is peculiar to the
# start of a real recording counts too much: a baseball's release was taken for a lag of the camera.
START = 5.0
ROWS_PER_TERM = (
    15  # rows per coefficient of the autoregression, at least: with fewer it follows the residual itself
)


@dataclass(frozen=True, slots=True)
class Whitener:
    """e_t = r_t - sum_i A_i r_(t-i), whitened by the inverse Cholesky factor of its covariance.

    The autoregression has to be stable: every eigenvalue of its companion matrix below 1 in size (`memory_limited`).
    """

    past: Array  # A_i, shape (order, c, c)
    inverse_factor: Array  # (c, c)
    size: Array | None = None  # root mean square (c,) of the residual from which it was estimated

    @property
    def order(self) -> int:
        return len(self.past)

    @property
    def innovation_sd(self) -> Array:
        """Standard deviation of the one-step error per channel, in its unit."""
        factor = np.linalg.inv(self.inverse_factor)
        return np.asarray(np.sqrt(np.sum(factor**2, axis=1)), float)

    @property
    def start(self) -> Array:
        """Factor (c,) of each of the first `order` rows of a block: together they count as one row."""
        if self.size is None:
            return np.zeros(self.inverse_factor.shape[0])
        return np.asarray(1.0 / (START * np.sqrt(max(self.order, 1)) * self.size), float)

    def whiten(self, rows: Array) -> Array:
        """rows (n, c, k) of a block -> whitened (n, c, k)."""
        return np.concatenate([rows[: self.order] * self.start[:, None], self.apply(rows)])

    def apply(self, rows: Array) -> Array:
        """rows (n, c, k) -> whitened (n - order, c, k): only those with the whole past that the autoregression uses."""
        n, c, k = rows.shape
        flat = np.ascontiguousarray(rows.transpose(1, 0, 2)).reshape(c, n * k)
        e = flat[:, self.order * k :].copy()
        for i, A in enumerate(self.past, start=1):
            e -= A @ flat[:, (self.order - i) * k : (n - i) * k]
        return np.asarray((self.inverse_factor @ e).reshape(c, n - self.order, k).transpose(1, 0, 2), float)


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
    problem: Problem, residual: Array, used: float, known: Noise, raw: Array, spared: set[int]
) -> Noise:
    """The noise without rows that nothing explains; arguments as of `estimate_noise`.

    raw: the residual with what candidates could explain; spared: groups of which too much would go, and which keep their rows.
    """
    noise = estimate_noise(problem, residual, used, known)
    out = _marked(problem, noise, residual - known.initial_part(residual)[0], raw, spared)
    if not any(rows.any() for rows in out):
        return Noise(problem, noise.whiteners, known.initial_uncertainty)
    return estimate_noise(
        problem, residual, used, Noise(problem, noise.whiteners, known.initial_uncertainty, out)
    )


def restored(problem: Problem, residual: Array, used: float, noise: Noise) -> Noise:
    """The noise with rows back in that were only predicted from an outlier; arguments as of `estimate_noise`."""
    out = list(noise.set_aside)
    for at in _by_group(problem):
        own = [residual[r.start : r.stop].reshape(r.shape) for r in (problem.blocks[i] for i in at)]
        for i, rows in zip(at, without_echoes(own, [out[i] for i in at]), strict=True):
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


def _marked(problem: Problem, noise: Noise, left: Array, raw: Array, spared: set[int]) -> tuple[Mask, ...]:
    """Rows of every block that nothing explains; groups of which too much would go keep all of theirs, and join the spared ones."""
    errors, before = noise.errors(left), noise.errors(raw)
    out = list(noise.set_aside) or [np.zeros(block.shape[0], bool) for block in problem.blocks]
    for group, at in enumerate(_by_group(problem)):
        own, was, known = [errors[i] for i in at], [before[i] for i in at], [out[i] for i in at]
        marked = None if group in spared else unexplained_steps(own, was, known)
        if marked is None:
            spared.add(group)
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


def autoregression(
    blocks: Sequence[Block],
    residual: Array,
    freedom_correction: float,
    floors: Array,
    set_aside: Sequence[Mask] = (),
) -> Whitener:
    """The order by BIC; memory of every channel for itself where there are too few rows for one that couples them.

    set_aside: rows of each block that neither are predicted nor predict others.
    """
    c = blocks[0].shape[1]
    shortest = min(block.shape[0] for block in blocks)
    total = sum(block.shape[0] for block in blocks)
    longest = max(0, min(HIGHEST_ORDER, shortest // 4, total // ROWS_PER_TERM))
    coupled = min(longest, total // (ROWS_PER_TERM * c))
    parts = [residual[block.start : block.stop].reshape(block.shape) for block in blocks]
    # the same rows for every order, or BIC would compare different data
    target = np.concatenate([part[longest:] for part in parts])
    lags = [
        np.concatenate([part[longest - i : len(part) - i] for part in parts]) for i in range(1, longest + 1)
    ]
    if any(rows.any() for rows in set_aside):
        sound = np.concatenate([~after(rows, longest)[longest:] for rows in set_aside])
        target, lags = target[sound], [lag[sound] for lag in lags]
    found = [(order * c * c, past) for order, past in enumerate(_coupled(lags[:coupled], target))]
    if coupled < longest:
        found += [(order * c, past) for order, past in enumerate(_alone(lags, target)) if order > 0]
    best: tuple[float, Array, Array] | None = None
    for size, past in found:
        matrices = memory_limited(past, shortest)
        error = target - sum((x @ A.T for x, A in zip(lags, matrices, strict=False)), np.zeros_like(target))
        covariance = error.T @ error / max(len(target) - size // c, 1)
        covariance += np.diag(1e-18 + 1e-12 * np.var(target, axis=0))
        score = len(target) * float(np.linalg.slogdet(covariance)[1]) + np.log(len(target)) * size
        if best is None or score < best[0]:
            best = (score, matrices, covariance)
    assert best is not None
    _, matrices, covariance = best
    return Whitener(
        matrices,
        np.linalg.inv(np.linalg.cholesky(covariance * freedom_correction + np.diag(floors**2))),
        np.sqrt(freedom_correction * np.mean(target**2, axis=0) + np.diag(covariance) + floors**2),
    )


def _coupled(lags: Sequence[Array], target: Array) -> Iterator[Array]:
    """Least squares for every order from 0, each (order, c, c); orders are nested: one triangular factor serves all."""
    c, highest = target.shape[1], len(lags)
    factor: Array = np.asarray(np.linalg.qr(np.concatenate([*lags, target], axis=1), mode="r"))
    for order in range(highest + 1):
        solved = np.linalg.lstsq(factor[:, : order * c], factor[:, highest * c :], rcond=None)[0]
        yield np.asarray(solved.reshape(order, c, c).transpose(0, 2, 1), float)


def _alone(lags: Sequence[Array], target: Array) -> Iterator[Array]:
    """The same with every channel predicted from its own past only."""
    each = [_coupled([x[:, i : i + 1] for x in lags], target[:, i : i + 1]) for i in range(target.shape[1])]
    for pasts in zip(*each, strict=True):
        own = np.stack([past[:, 0, 0] for past in pasts], axis=1)
        yield np.stack([np.diag(row) for row in own]) if len(own) else np.zeros((0, len(pasts), len(pasts)))


def memory_limited(past: Array, samples: int) -> Array:
    """The autoregression with its memory limited to a quarter of a block of so many samples.

    An autoregression that integrates, or grows, would call any slow mismatch noise.
    """
    order = len(past)
    if order == 0:
        return past
    # the largest eigenvalue of the companion matrix is the factor by which the slowest memory decays per sample
    radius = float(np.max(np.abs(np.linalg.eigvals(companion(past)))))
    allowed = 1.0 - 4.0 / max(samples, 8)
    if radius <= allowed:
        return past
    # scaling A_i by r^i scales every eigenvalue by r and keeps the form of the memory
    return past * ((allowed / radius) ** np.arange(1, order + 1))[:, None, None]


def companion(past: Array) -> Array:
    """The autoregression (order, c, c) as one step of a state that holds `order` rows, the newest first (order c, order c)."""
    order, c = past.shape[:2]
    matrix = np.zeros((order * c, order * c))
    matrix[:c] = np.concatenate(list(past), axis=1)
    matrix[c:, :-c] = np.eye((order - 1) * c)
    return matrix
