"""When a temporary effect begins and ends: a sensor that is wrong from within a window on."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.judge import judge
from discrepancy.estimation.problem import Problem
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import signal
from tests.discrepancy.toys import record, tank

BIAS = 0.3
QUIET = Settings(open_ended=False)


def wrong(from_s, until_s, seed=4):
    whole = record(seed, duration_s=240.0)
    level = whole.signals["level"]
    inside = (level.time_s >= from_s) & (level.time_s < until_s)
    return replace(
        whole, signals={**whole.signals, "level": replace(level, value=level.value + BIAS * inside)}
    )


@pytest.mark.parametrize(("from_s", "until_s"), [(107.0, 240.0), (68.0, 151.0)])
def test_begin_and_end_are_found_within_a_window(from_s, until_s):
    found = judge(Problem(tank("leak", "level bias"), [wrong(from_s, until_s)]), QUIET).findings
    assert found.status == "explained", found.reasons
    (bias,) = found.findings
    (interval,) = bias.where.intervals
    # windows of 20 s, cut into quarters
    assert interval.start_s == pytest.approx(from_s, abs=5.0)
    assert interval.end_s == pytest.approx(until_s, abs=5.0)
    (size,) = bias.parameters
    assert size.low < BIAS < size.high


def test_further_edges_cut_windows_and_lose_no_reading():
    recording = record(1)
    whole = Problem(tank(), [recording])
    cut = whole.again(edges={"tank": [23.0, 27.0]}).again(edges={"tank": [29.0]})
    assert [w.start_s for w in cut.windows[:6]] == pytest.approx([0.0, 20.0, 23.0, 27.0, 29.0, 40.0])
    assert len(cut.windows) == len(whole.windows) + 3
    assert cut.samples == whole.samples
    for other in (
        cut.again(finer=2),
        cut.again(model=tank("leak")),
        cut.again(row_period_s={("level",): 0.4}),
    ):
        assert [w.start_s for w in other.windows] == [w.start_s for w in cut.windows]


def test_edges_of_another_recording_cut_nothing():
    whole = Problem(tank(), [record(1)])
    assert len(whole.again(edges={"another": [23.0]}).windows) == len(whole.windows)


def test_a_fault_within_a_window_of_a_channel_that_is_oversampled():
    """Twenty samples to a step: sizes are also fitted to rows of several samples, which lie in the same windows."""
    seen, rng = wrong(0.0, 0.0), np.random.default_rng(4)
    level = seen.signals["level"]
    fast_s = np.arange(0.0, level.time_s[-1], 0.005)
    read = np.interp(fast_s, level.time_s, level.value) + rng.normal(0.0, 0.02, fast_s.size)
    fast = signal(fast_s, read + BIAS * (fast_s >= 107.0), "m")
    recording = replace(seen, signals={**seen.signals, "level": fast})
    found = judge(Problem(tank("leak", "level bias"), [recording]), QUIET).findings
    (bias,) = [f for f in found.findings if f.effect == "level bias"]
    assert bias.where.intervals[0].start_s == pytest.approx(107.0, abs=5.0)
    (size,) = bias.parameters
    assert size.low < BIAS < size.high
