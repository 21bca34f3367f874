"""When a temporary effect begins and ends: a sensor that is wrong from within a window on."""

from dataclasses import replace

import pytest

from discrepancy.decision.judge import judge
from discrepancy.estimation.problem import Problem
from discrepancy.selection.state import Settings
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
    cut = whole.cut_at({"tank": [23.0, 27.0]}).cut_at({"tank": [29.0]})
    assert [w.start_s for w in cut.windows[:6]] == pytest.approx([0.0, 20.0, 23.0, 27.0, 29.0, 40.0])
    assert len(cut.windows) == len(whole.windows) + 3
    assert cut.samples == whole.samples
    assert cut.finer(2).windows[2].start_s == pytest.approx(23.0)
    assert cut.of(tank("leak")).edges == {"tank": (23.0, 27.0, 29.0)}


def test_edges_of_another_recording_cut_nothing():
    whole = Problem(tank(), [record(1)])
    assert len(whole.cut_at({"another": [23.0]}).windows) == len(whole.windows)
