"""What the sensor of each output may be off by: its error budget, with the source of the figure. For the judgement of adequacy.

The model's author may give it (`Model.sensor_noise`, from the sensor's sheet). Else it is measured on the recording, as the largest of
three figures of which each is a lower bound of what the sensor does while the machine works: half a step of its resolution, its
scatter at standstill, and the first differences of what the model leaves. No stationary noise, whatever its colour, has one-step
errors above the root mean square of its first differences, since the last value is a prediction too.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import chi2

from discrepancy import gates
from discrepancy.estimation.problem import Problem
from discrepancy.signals.adequacy import Source
from discrepancy.signals.recording import Array

SURE: Final = 1e9  # degrees of freedom of a figure that was not estimated
CALM: Final = 0.9  # share of squared differences that is used: contacts and outliers are errors, not noise
CALM_MEAN: Final = float(
    chi2.cdf(chi2.ppf(CALM, 1), 3) / CALM
)  # mean of that share for Gaussian noise of size 1
CORRELATED: Final = 1.5  # differences of white noise: rows for an independent square (1 + 2 * 0.5²)
WHOLE: Final = 0.05  # of a step, by which distances of codes may be off
CODED: Final = 0.95  # share of the distances of codes that must be whole steps
LEAST: Final = 1e-9  # of the largest value: rounding of numbers
DRIFT: Final = (
    1.0  # of its own scatter, by which the halves of a standstill may differ; those of a ramp differ by 1.7
)


@dataclass(frozen=True, slots=True)
class Budget:
    """Standard deviation of the error of one output."""

    value: float  # in the unit of the output
    source: Source
    freedom: float  # degrees of freedom of the figure


def budgets(problem: Problem, left: Array) -> dict[str, Budget]:
    """By channel; left: raw rows (N,) that the model with all findings leaves of the measurement."""
    return {
        name: _stated(problem, name, i) or _measured(problem, left, name, i)
        for i, name in enumerate(problem.channels)
    }


def _stated(problem: Problem, name: str, channel: int) -> Budget | None:
    """From the model's sensor sheet; the resolution seen counts beside it."""
    noise = problem.model.sensor_noise.get(name)
    if noise is None:
        return None
    step = resolution(problem.measured[problem.row_channel == channel])
    floor = problem.model.floors.get(name, 0.0)
    return Budget(float(np.sqrt(noise**2 + floor**2 + step**2 / 12.0)), "sensor sheet", SURE)


def _measured(problem: Problem, left: Array, name: str, channel: int) -> Budget:
    values = problem.measured[problem.row_channel == channel]
    at_rest = list(_standstills(problem, name))
    squares = np.concatenate([(part - np.mean(part)) ** 2 for part in at_rest] or [np.zeros(0)])
    changes = np.concatenate([np.diff(part) ** 2 for _, part in _parts(problem, left, name)])
    calm = changes[changes <= np.quantile(changes, CALM)]
    found = [
        Budget(0.5 * resolution(values), "resolution", SURE),
        Budget(
            float(np.sqrt(np.sum(squares) / max(squares.size - len(at_rest), 1))),
            "standstill",
            float(max(squares.size - len(at_rest), 1)),
        ),
        Budget(float(np.sqrt(np.mean(calm) / CALM_MEAN)), "differences", max(changes.size / CORRELATED, 1.0)),
    ]
    least = LEAST * float(np.max(np.abs(values)))
    best = max(found, key=lambda b: b.value)
    return best if best.value > least else Budget(max(least, 1e-300), "resolution", SURE)


def resolution(values: Array) -> float:
    """The step between the codes of a channel; 0 where it has none that shows."""
    codes = np.unique(values)
    apart = np.diff(codes)
    apart = apart[apart > LEAST * max(float(np.max(np.abs(codes), initial=0.0)), 1e-300)]
    if apart.size < 2:
        return 0.0
    step = float(np.min(apart))
    steps = apart / step
    whole = np.abs(steps - np.round(steps)) < WHOLE * np.maximum(1.0, 0.01 * steps)
    # values of a continuous quantity are also near a multiple of the smallest distance by chance, but hardly ever repeat
    repeats = codes.size < 0.9 * values.size
    return step if repeats and float(np.mean(whole)) >= CODED else 0.0


def _parts(problem: Problem, rows: Array, name: str) -> Iterator[tuple[Array, Array]]:
    """Stamps and rows of one channel, block by block."""
    for block in problem.blocks:
        if name in block.channels:
            own = rows[block.start : block.stop].reshape(block.shape)[:, block.channels.index(name)]
            yield block.time_s, own


def _standstills(problem: Problem, name: str) -> Iterator[Array]:
    """Readings of a channel where no input moves and the channel itself does not drift."""
    fewest = int(gates.SAMPLES_TO_CHECK.threshold)
    blocks = [block for block in problem.blocks if name in block.channels]
    whole = np.concatenate([values for _, values in _parts(problem, problem.measured, name)])
    # a car that turns under constant commands does not stand still: its scatter is motion
    most = gates.DISTURBANCE_SHARE.threshold * float(np.std(whole))
    for block, (time_s, values) in zip(blocks, _parts(problem, problem.measured, name), strict=True):
        window = problem.windows[block.window]
        inputs = [window[n] for n in problem.model.inputs if window.has(n)]
        if not inputs:
            continue
        moving = np.any([np.diff(x, prepend=x[:1]) != 0.0 for x in inputs], axis=0)
        at = np.clip(np.searchsorted(window.time_s, time_s), 0, window.time_s.size - 1)
        since = np.cumsum(moving)[at]  # the same number: no input moved in between
        for part in np.split(values, np.flatnonzero(np.diff(since)) + 1):
            if part.size >= fewest and np.std(part) < most and _steady(part):
                yield part


def _steady(values: Array) -> bool:
    """Whether a reading scatters and does not drift. Slow noise may move the mean of a half, so its scatter is the measure."""
    first, second = np.array_split(values, 2)
    return bool(abs(np.mean(first) - np.mean(second)) <= DRIFT * np.std(values))
