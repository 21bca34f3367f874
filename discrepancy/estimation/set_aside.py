"""Readings that nothing explains: single outliers, and intervals of time in which the error is far larger than elsewhere.

Under Gaussian noise a few such readings rule the noise of a whole recording, and with it everything that is decided by it. They are taken out of the
noise, the fits and the tests, and are reported with their time. Thresholds are so high that a recording without them loses no row.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy import gates
from discrepancy.model.windows import Block
from discrepancy.signals.recording import Array

Mask = NDArray[np.bool_]

OUTLIER: Final = gates.OUTLIER.threshold
ODD_INTERVAL: Final = gates.ODD_INTERVAL.threshold
MOST_SHARE: Final = gates.SET_ASIDE.threshold
STEPS: Final = 10  # rows in a row over which an interval is judged
MOST_EACH: Final = 1.5 * ODD_INTERVAL  # that a row counts for in an interval: one outlier is none
INNER: Final = 1.0 - MOST_SHARE  # share of the errors that are no outliers in any case
INNER_SD: Final = 0.8939  # root mean square of a normal error of unit size, when what is beyond that share is moved to its edge
EXPLAINED: Final = 0.5  # share of the squared errors of an interval that candidates have to leave there
MANY: Final = (
    0.4  # share of rows with a large residual of their own, from which rows in a row are one interval
)
BESIDE: Final = 0.02  # of a wrong reading's size: what is smaller is no part of it
USUAL: Final = 0.95  # share of a channel's rows that are as it usually is; not more, because each wrong reading makes three rows
FAR: Final = 5.0  # times as far as the farthest usual row, from which on a reading is wrong; some ten standard deviations if errors are normal
STAYED: Final = 0.5  # of a jump, from which on it has moved something
NORMAL: Final = 1.4826  # standard deviations in a median absolute deviation


@dataclass(frozen=True, slots=True)
class OddInterval:
    """Rows of one block, one after the other, that nothing explains."""

    window: int
    channels: tuple[str, ...]
    start_s: float
    end_s: float
    rows: int
    size: float  # root mean square of the largest channel's error there, over that of the rest


@dataclass(frozen=True, slots=True)
class SetAside:
    """What a search leaves out."""

    rows: tuple[Mask, ...] = ()  # of every block; empty: none
    intervals: tuple[OddInterval, ...] = ()


NOTHING: Final = SetAside()


def unexplained_steps(
    errors: Sequence[Array], before: Sequence[Array], known: Sequence[Mask], *, with_intervals: bool = True
) -> list[Mask] | None:
    """For the blocks of one group: which of their rows nothing explains (n,); None where that is too much of the recording to be set aside.

    errors: of one-step predictions, per block (n - order, c), what candidates could do taken out; before: with it; known: rows that are out already;
    with_intervals: intervals of time too, not only outliers.
    """
    kept = [e[~out[out.size - len(e) :]] for e, out in zip(errors, known, strict=True)]
    scale = _scale(np.concatenate(kept))
    found = []
    for e, was, out in zip(errors, before, known, strict=True):
        size = np.abs(e) / scale
        late = out.copy()
        first = out.size - len(e)
        new = np.any(size > OUTLIER, axis=1)
        if with_intervals:
            new |= _in_intervals(size)
        # candidates enter to first order: what they explain for the most part is a strong effect, not a riddle
        for start, stop in _spans(new):
            if np.sum(e[start:stop] ** 2) < EXPLAINED * np.sum(was[start:stop] ** 2):
                new[start:stop] = False
        late[first:] |= new
        found.append(late)
    share = sum(int(late.sum()) for late in found) / sum(late.size for late in found)
    return found if share <= MOST_SHARE else None


def _scale(errors: Array) -> Array:
    """Standard deviation (c,) of the errors that are not outliers."""
    size = np.abs(errors)
    spread = NORMAL * np.median(size, axis=0)
    # readings that often repeat have a median error near zero
    inner = np.minimum(size, np.quantile(size, INNER, axis=0))
    whole = np.sqrt(np.mean(inner**2, axis=0)) / INNER_SD
    return np.asarray(np.maximum(np.maximum(spread, whole), 1e-300), float)


def _in_intervals(size: Array) -> Mask:
    """Which rows (n,) lie in some STEPS rows that together are too large; size: (n, c) in standard deviations."""
    steps = min(STEPS, len(size))
    sums = np.cumsum(np.concatenate([np.zeros((1, size.shape[1])), np.minimum(size, MOST_EACH) ** 2]), axis=0)
    large = np.any((sums[steps:] - sums[:-steps]) / steps > ODD_INTERVAL**2, axis=1)
    return np.asarray(np.convolve(large, np.ones(steps)) > 0.5, bool)


def without_echoes(residuals: Sequence[Array], out: Sequence[Mask]) -> list[Mask]:
    """Of rows that are out, those whose own residual (n, c) is large, unless they are many: predictions from an outlier are off as well."""
    scale = _scale(np.concatenate([r[~rows] for r, rows in zip(residuals, out, strict=True)]))
    found = []
    for residual, rows in zip(residuals, out, strict=True):
        large, kept = np.any(np.abs(residual) > ODD_INTERVAL * scale, axis=1) & rows, rows.copy()
        for start, stop in _spans(rows):
            share = float(np.mean(large[start:stop]))
            if 0.0 < share < MANY:
                kept[start:stop] = large[start:stop]
        found.append(kept)
    return found


def wrong_readings(residuals: Sequence[Array], out: Sequence[Mask]) -> list[Mask]:
    """Of rows that are out, those that stand alone, with a residual (n, c) that goes there and back: far from both neighbours.

    A disturbance of the machine also makes one large error of prediction, but what it moved stays moved (additive and innovational outliers, Fox
    1972). Predictions from a wrong reading are off as well: with the reading mended, what follows it has to be inconspicuous.
    """
    scale = _scale(np.concatenate([_there(r) for r in residuals]))
    found = []
    for residual, rows in zip(residuals, out, strict=True):
        kept = np.zeros_like(rows)
        there = np.max(np.abs(_there(residual)) / scale, axis=1, initial=0.0)
        for start, stop in _spans(rows):
            # the first and the last row have one neighbour, and stay
            inner = range(max(start, 1), min(stop, rows.size - 1))
            if not inner:
                continue
            at = max(inner, key=lambda row: there[row - 1])
            kept[at] = _goes_back(residual, at, scale) and not _more(residual, at, inner, scale)
        found.append(kept)
    return found


def too_early(residuals: Sequence[Array], order: int) -> list[Mask]:
    """Per block: wrong readings among the first `order` rows of its residual (n, c), which have no past to be predicted from."""
    scale = _scale(np.concatenate([_there(r) for r in residuals]))
    found = []
    for residual in residuals:
        early = np.zeros(len(residual), bool)
        for row in range(1, min(order, len(residual) - 1)):
            early[row] = _goes_back(residual, row, scale)
        found.append(early)
    return found


def lone_readings(blocks: Sequence[Block], residuals: Sequence[Array]) -> list[tuple[int, int, OddInterval]]:
    """Wrong readings of one channel, with the numbers of their block and row; of a residual (n, c) for each block.

    The channel goes there and back, and no other is conspicuous at that time: a blow to the machine is felt by more than one sensor. So rare by
    construction: a channel of which a sixtieth is wrong has, by `_scales`, none.
    """
    scales = _scales(blocks, residuals)
    sizes = [np.abs(_there(r)) / scales.get(b.group, np.inf) for b, r in zip(blocks, residuals, strict=True)]
    found = []
    for i, (block, residual) in enumerate(zip(blocks, residuals, strict=True)):
        for row in (1 + np.flatnonzero(np.any(sizes[i] > OUTLIER, axis=1))).tolist():
            channel, scale = int(np.argmax(sizes[i][row - 1])), scales[block.group]
            size, at_s = float(sizes[i][row - 1, channel]), float(block.time_s[row])
            most = max(ODD_INTERVAL, BESIDE * size)
            near = range(max(row - 1, 1), min(row + 2, len(residual) - 1))
            if (
                _goes_back(residual[:, [channel]], row, scale[[channel]])
                and not _more(residual, row, near, scale, most, channel)
                and _largest_elsewhere(blocks, sizes, block, at_s) <= most
            ):
                reading = OddInterval(block.window, (block.channels[channel],), at_s, at_s, 1, size)
                found.append((i, row, reading))
    return found


def _largest_elsewhere(blocks: Sequence[Block], sizes: Sequence[Array], block: Block, at_s: float) -> float:
    """The largest size in the other blocks of a window about a time."""
    others = [
        size[_about(other.time_s, at_s)]
        for other, size in zip(blocks, sizes, strict=True)
        if other.window == block.window and other.group != block.group and len(size)
    ]
    return max((float(np.max(size, initial=0.0)) for size in others), default=0.0)


def _scales(blocks: Sequence[Block], residuals: Sequence[Array]) -> dict[int, Array]:
    """By group of blocks: standard deviation (c,) of what `_there` gives of readings that are not wrong; none where no row has two neighbours."""
    found = {}
    for group in {block.group for block in blocks}:
        own = [_there(r) for block, r in zip(blocks, residuals, strict=True) if block.group == group]
        there = np.concatenate(own)
        if there.size:
            # some channels jump by themselves: pressures, when a valve opens
            usual = np.quantile(np.abs(there), USUAL, axis=0)
            found[group] = np.maximum(_scale(there), FAR / OUTLIER * usual)
    return found


def _about(time_s: Array, at_s: float) -> Mask:
    """Which rows but the first and the last are within two rows of a time."""
    return np.asarray(np.abs(time_s[1:-1] - at_s) <= 2.0 * float(np.median(np.diff(time_s))), bool)


def _there(residual: Array) -> Array:
    """How far each row but the first and the last (n - 2, c) is from the middle of its neighbours."""
    return np.asarray(residual[1:-1] - 0.5 * (residual[:-2] + residual[2:]), float)


def _goes_back(residual: Array, at: int, scale: Array) -> bool:
    there = residual[at] - 0.5 * (residual[at - 1] + residual[at + 1])
    stayed = residual[at + 1] - residual[at - 1]
    return bool(np.any((np.abs(there) > OUTLIER * scale) & (np.abs(stayed) < STAYED * np.abs(there))))


def _more(
    residual: Array,
    at: int,
    rows: range,
    scale: Array,
    most: float = ODD_INTERVAL,
    channel: int | None = None,
) -> bool:
    """Whether something else is conspicuous too when one row, or of it one channel, is replaced by the middle of its neighbours."""
    mended, which = residual.copy(), slice(None) if channel is None else channel
    mended[at, which] = 0.5 * (residual[at - 1, which] + residual[at + 1, which])
    there = np.max(np.abs(_there(mended)) / scale, axis=1)
    return any(there[row - 1] > most for row in rows)


def _spans(rows: Mask) -> list[tuple[int, int]]:
    """Begin and end of each sequence of true values."""
    edges = np.flatnonzero(np.diff(rows.astype(int), prepend=0, append=0))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def same_rows(one: Sequence[Mask], other: Sequence[Mask]) -> bool:
    """Whether the same rows are out; none at all is written in two ways."""
    return (
        all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
        if len(one) == len(other)
        else not any(rows.any() for rows in (*one, *other))
    )


def after(out: Mask, order: int) -> Mask:
    """Rows whose prediction uses one that is out, and those themselves."""
    touched = out.copy()
    for lag in range(1, order + 1):
        touched[lag:] |= out[:-lag]
    return touched


def intervals(blocks: Sequence[Block], errors: Sequence[Array], out: Sequence[Mask]) -> list[OddInterval]:
    """What is out, as intervals of time; errors: as in `unexplained_steps`."""
    kept = np.concatenate([e[~o[o.size - len(e) :]] for e, o in zip(errors, out, strict=True)])
    rms, found = np.sqrt(np.mean(kept**2, axis=0)), []
    for block, e, rows in zip(blocks, errors, out, strict=True):
        for start, stop in _spans(rows):
            own = e[max(start - (rows.size - len(e)), 0) : stop - (rows.size - len(e))]
            if not len(own):
                continue
            sizes = np.sqrt(np.mean(own**2, axis=0)) / np.maximum(rms, 1e-300)
            found.append(
                OddInterval(
                    block.window,
                    block.channels,
                    float(block.time_s[start]),
                    float(block.time_s[stop - 1]),
                    stop - start,
                    float(np.max(sizes)),
                )
            )
    return found
