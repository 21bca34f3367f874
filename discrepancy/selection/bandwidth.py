"""Decimation of oversampled channels to the bandwidth of the model: their rows become means over neighbouring samples.

One-step errors weigh every frequency by the noise there alone. Far above the frequencies at which a model moves there is hardly any noise, and the last
thousandth of its movement, which no model has right, outweighs all of its physics. Rows therefore come no faster than they have to for
what parameters do to the outputs.
"""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from discrepancy import gates
from discrepancy.estimation.autoregression import HIGHEST_ORDER, ROWS_PER_TERM
from discrepancy.estimation.fit import differences
from discrepancy.estimation.noise import by_group
from discrepancy.estimation.problem import Problem
from discrepancy.model.windows import FEWEST_SAMPLES, Block, means_of
from discrepancy.selection.screen import sensitivities
from discrepancy.signals.recording import Array, Complaint

FEWEST_ROWS: Final = 2 * HIGHEST_ORDER * ROWS_PER_TERM  # of a channel: twice what the noise model may need
OVERSAMPLED: Final = (
    8  # samples in a row from which on a complaint says it: a slower logger would have done as well
)
ROWS_PER_PERIOD: Final = 4  # of the highest frequency at which a model is said to be right
INVISIBLE: Final = 1e-12  # share of a sensitivity beyond initial states, below which it is rounding

Channels = tuple[str, ...]


def at_bandwidth(problem: Problem) -> tuple[Problem, list[Complaint]]:
    """The problem with no more rows than its model needs, and a complaint on each channel that is sampled far faster.

    Models whose simulations are expensive are left as they are: their recordings come at rates that were chosen for them.
    """
    if problem.costs.costly:
        return problem, []
    periods = row_periods(problem)
    if not periods:
        return problem, []
    decimated = problem.again(row_period_s=periods)
    return decimated, [*_oversampled(decimated)]


def row_periods(problem: Problem) -> dict[Channels, float]:
    """Time between rows [s] for each group of channels that is recorded faster than its model needs; at one simulation per parameter and trial step.

    Runs of one group that were sampled at several rates come to rows of the slowest, because they share one model of their noise.
    """
    found: dict[Channels, float] = {}
    bandwidth_hz = problem.model.bandwidth_hz
    effects = [] if bandwidth_hz is not None else list(_effect_columns(problem))
    for blocks in by_group(problem.blocks):
        steps = [float(np.median(np.diff(block.sample_s))) for block in blocks]
        slowest, each = max(steps), 1
        while _enough_rows(blocks, 2 * each * slowest) and (
            bandwidth_hz is None or 2 * each * slowest * bandwidth_hz * ROWS_PER_PERIOD <= 1.0
        ):
            if any(
                _lost(blocks, trials, 2 * each) > 1.0 - gates.CONTENT_KEPT.threshold for trials in effects
            ):
                break
            each *= 2
        if each > 1 or slowest > 1.5 * min(steps):
            found[blocks[0].channels] = each * slowest
    return found


def _enough_rows(blocks: Sequence[Block], period_s: float) -> bool:
    rows = [int(np.ptp(block.sample_s) / period_s) for block in blocks]
    return min(rows) >= FEWEST_SAMPLES and sum(rows) >= FEWEST_ROWS


def _effect_columns(problem: Problem) -> Iterator[list[Array]]:
    """For every parameter: raw sensitivities (N,) beyond initial states, one per trial step."""
    values = problem.start()
    base = problem.predict(values)
    local = differences(problem, values, base, problem.local_names)
    for name in problem.nuisance_names:
        yield [_beyond_states(problem, differences(problem, values, base, [name])[:, 0], local)]
    for columns in sensitivities(problem, values, base, problem.model.effects):
        for own in range(len(columns.effect.amplitude_parameters)):
            yield [_beyond_states(problem, raw[:, own], local) for raw in columns.raw]


def _beyond_states(problem: Problem, raw: Array, local: Array) -> Array:
    """A column without what the initial states of each window can do, channel by channel, because channels differ in unit."""
    left = raw.copy()
    if local.shape[1] == 0:
        return left
    part_of = problem.row_window * len(problem.channels) + problem.row_channel
    for part in np.unique(part_of):
        own = part_of == part
        left[own] -= local[own] @ np.linalg.lstsq(local[own], raw[own], rcond=None)[0]
        if np.sum(left[own] ** 2) < INVISIBLE * np.sum(raw[own] ** 2):
            left[own] = 0.0
    return left


def _lost(blocks: Sequence[Block], trials: Sequence[Array], each: int) -> float:
    """Largest share over channels of what a parameter does there that means over `each` samples lose, at the trial step that loses least.

    A lag that is shorter than a sample moves single samples; a change that matters has to be kept, not its smallest trial step.
    """
    channels = range(len(blocks[0].channels))
    return max(min(_lost_in(blocks, raw, channel, each) for raw in trials) for channel in channels)


def _lost_in(blocks: Sequence[Block], raw: Array, channel: int, each: int) -> float:
    kept = whole = 0.0
    for block in blocks:
        moved = raw[block.start : block.stop].reshape(block.shape)[:, channel]
        moved = moved[: moved.size - moved.size % each]
        kept += each * float(np.sum(means_of(moved, each) ** 2))
        whole += float(np.sum(moved**2))
    return 1.0 - kept / whole if whole > 0.0 else 0.0


def _oversampled(problem: Problem) -> Iterator[Complaint]:
    reported = set()
    for block in problem.blocks:
        recording = problem.windows[block.window].recording
        if block.averaged >= OVERSAMPLED and (recording, block.group) not in reported:
            reported.add((recording, block.group))
            sampled_hz = 1.0 / float(np.median(np.diff(block.sample_s)))
            text = (
                f"is sampled at {sampled_hz:.3g} Hz, where the model hardly moves above {sampled_hz / block.averaged / 2.0:.2g} Hz: "
                f"{block.averaged} samples are averaged to one"
            )
            yield Complaint(recording, ", ".join(block.channels), text, fatal=False)
