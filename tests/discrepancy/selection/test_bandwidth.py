"""Rows come no faster than the model moves, whatever the rate of the recording."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy import gates
from discrepancy.estimation.problem import Problem
from discrepancy.selection.bandwidth import OVERSAMPLED, at_bandwidth, row_periods
from discrepancy.signals.recording import Recording, signal
from tests.discrepancy.toys import record, tank

CHANNELS = ("level",)


def fast(every: int = 1, seed: int = 1) -> Recording:
    """A tank whose inflow changes each 2.5 s, its level read every 10 ms; every so many-th reading of it."""
    slow = record(seed, noise=0.0)
    time_s = np.arange(0.0, 119.0, 0.01)
    noise = np.random.default_rng(seed).normal(0.0, 0.02, time_s.size)
    level = np.interp(time_s, slow.signals["level"].time_s, slow.signals["level"].value) + noise
    return Recording("fast", {**slow.signals, "level": signal(time_s[::every], level[::every], "m")})


def test_rows_of_a_fast_recording_have_the_period_of_its_thinned_copies() -> None:
    periods = [row_periods(Problem(tank("leak"), [fast(every)]))[CHANNELS] for every in (1, 2, 4)]
    assert np.allclose(periods, periods[0], rtol=1e-6)
    assert periods[0] >= 0.08


def test_means_keep_the_energy_that_the_gate_asks_for_and_twice_as_many_samples_do_not() -> None:
    """Asked of the leak's own sensitivity, computed here by a finite change."""
    problem = Problem(tank("leak"), [fast()])
    each = round(row_periods(problem)[CHANNELS] / 0.01)
    start = problem.start()
    names = ["leak", "area"]
    local = problem.predict(replace(start, local={"level": start.local["level"] + 0.1}))
    base = problem.predict(start)
    lost = {}
    for count in (each, 2 * each):
        worst = 0.0
        for name in names:
            moved = problem.predict(start.having(**{name: start.shared[name] + 0.05})) - base
            kept = whole = 0.0
            for block in problem.blocks:
                rows = slice(block.start, block.stop)
                x, state = moved[rows], (local - base)[rows]
                x = x - state * (x @ state) / (state @ state)
                x = x[: x.size - x.size % count]
                kept += count * np.sum(x.reshape(-1, count).mean(axis=1) ** 2)
                whole += np.sum(x**2)
            worst = max(worst, 1.0 - kept / whole)
        lost[count] = worst
    least = 1.0 - gates.CONTENT_KEPT.threshold
    assert lost[each] < least
    assert lost[2 * each] > least or 11_900 // (2 * each) < 300


def test_a_row_is_the_mean_of_its_samples_recorded_and_predicted() -> None:
    every, mean = Problem(tank(), [fast()]), Problem(tank(), [fast()], {CHANNELS: 0.05})
    (block, *_), (rows, *_) = every.blocks, mean.blocks
    assert rows.averaged == 5
    for one, other in (
        (every.measured, mean.measured),
        (every.predict(every.start()), mean.predict(mean.start())),
    ):
        whole = one[block.start : block.stop][: 5 * rows.shape[0]]
        np.testing.assert_allclose(other[rows.start : rows.stop], whole.reshape(-1, 5).mean(axis=1))
    np.testing.assert_allclose(rows.time_s[:2], [0.02, 0.07], atol=1e-9)
    assert mean.samples == pytest.approx(every.samples, abs=5 * len(mean.windows))


def test_a_recording_that_is_not_oversampled_stays_as_it_is() -> None:
    problem = Problem(tank(), [record(1)])
    same, complaints = at_bandwidth(problem)
    assert same is problem
    assert complaints == []


def test_recordings_at_several_rates_share_rows_of_the_slowest() -> None:
    """One noise model serves both: its memory is counted in rows."""
    fine, coarse = fast(), replace(fast(16, seed=2), name="coarse")
    found, _ = at_bandwidth(Problem(replace(tank(), bandwidth_hz=1e3), [fine, coarse]))
    periods = [float(np.median(np.diff(block.time_s))) for block in found.blocks]
    assert np.allclose(periods, 0.16, rtol=1e-3)


def test_a_bandwidth_of_the_model_is_kept_to() -> None:
    found, _ = at_bandwidth(Problem(replace(tank(), bandwidth_hz=3.0), [fast()]))
    assert {block.averaged for block in found.blocks} == {8}


def test_a_far_too_fast_channel_is_complained_of_once_with_both_rates() -> None:
    found, complaints = at_bandwidth(Problem(tank("leak"), [fast()]))
    assert found.blocks[0].averaged >= OVERSAMPLED
    (complaint,) = complaints
    assert complaint.signal == "level"
    assert complaint.text.startswith("is sampled at 100 Hz")
    assert not complaint.fatal


def test_expensive_models_keep_the_rates_that_were_chosen_for_them() -> None:
    problem = Problem(replace(tank(), jacobian_reach=1.0), [fast()])
    assert at_bandwidth(problem) == (problem, [])
    assert problem.simulations == 0
