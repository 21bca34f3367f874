"""A vector autoregression of residuals, and the whitening of rows with it.

A whitened residual is the error of a one-step predictor, which uses the residual's own past. BIC chooses the order. Evenly spaced samples
are assumed: jitter is neglected. Pauses that scatter by 30 % change neither a delay's estimate nor its spread noticeably (24 drives; interpolating
the rows to even times made no difference).

The first rows of a block have too short a past for the autoregression. Left out, they would leave initial states nearly free: beside a
noise with a long memory, states would run far from what was measured and imitate any slow effect in a short window. So together they count
as one row whose standard deviation is five times the size of the residual.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.estimation.set_aside import Mask, after
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
    """e_t = r_t - sum_i A_i r_(t-i), whitened by the inverse Cholesky factor of its covariance."""

    past: Array  # A_i, shape (order, c, c)
    inverse_factor: Array  # (c, c)
    # root mean square (c,) of the residual from which it was estimated, with its one-step error; None: the first rows of a block count for nothing
    size: Array | None = None

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
