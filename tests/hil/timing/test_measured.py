"""Timing is judged by its figures, and not at all when the host was starved."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.timing.host import HostClock, waited_ns
from hil.timing.measured import Spread, Timing, judge_task, judge_timing, reaction_ns
from hil.verdict import Result

MS = 1_000_000
GOOD = Timing(
    lateness={"plant": Spread.of([MS // 10] * 100), "ecu": Spread.of([MS // 5] * 100)},
    execution={"plant": Spread.of([MS // 2] * 100)},
    reaction=Spread.of([6 * MS] * 100),
    overruns={"plant": 0, "ecu": 0},
    dropped=0,
    stolen=0.0,
    waited={"plant": 0.001},
)


def test_a_run_in_time_passes():
    assert judge_timing(GOOD).result is Result.PASSED


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"overruns": {"plant": 0, "ecu": 3}}, "ecu skipped 3 ticks"),
        ({"dropped": 2}, "2 frames lost"),
        ({"lateness": dict.fromkeys(("plant", "ecu"), Spread.of([6 * MS] * 100))}, "plant starts late"),
        ({"execution": {"ecu": Spread.of([6 * MS] * 100)}}, "ecu takes too long"),
        ({"reaction": Spread.of([25 * MS] * 100)}, "reaction"),
    ],
)
def test_each_miss_fails_and_is_named(change, named):
    verdict = judge_timing(replace(GOOD, **change))
    assert verdict.result is Result.FAILED
    assert named in verdict.reason


@pytest.mark.parametrize("change", [{"stolen": 0.02}, {"waited": {"plant": 0.04}}, {"stolen": float("nan")}])
def test_a_starved_host_excuses_what_was_late_and_nothing_else(change):
    assert judge_timing(replace(GOOD, **change)).result is Result.PASSED
    verdict = judge_timing(replace(GOOD, **change, overruns={"plant": 9}))
    assert verdict.result is Result.INCONCLUSIVE
    assert "starved" in verdict.reason
    assert "skipped 9 ticks" in verdict.reason


@pytest.mark.parametrize("change", [{"lateness": {}}, {"reaction": Spread.of([])}])
def test_what_was_not_measured_cannot_pass(change):
    assert judge_timing(replace(GOOD, **change)).result is Result.INCONCLUSIVE


def test_a_process_that_left_no_times_cannot_pass():
    """The ECU was killed: its overruns are known from the bus, its ticks from nobody."""
    verdict = judge_timing(replace(GOOD, lateness={"plant": GOOD.lateness["plant"]}))
    assert verdict.result is Result.INCONCLUSIVE
    assert "lateness of ecu" in verdict.reason
    task = judge_task(replace(GOOD, lateness={}, execution={}), "ecu")
    assert (task.result, task.start, task.execution) == (Result.INCONCLUSIVE, None, None)


BOTH = replace(GOOD, execution=GOOD.execution | {"ecu": Spread.of([MS] * 100)})


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"overruns": {"plant": 0, "ecu": 3}}, "skipped 3 ticks"),
        ({"lateness": BOTH.lateness | {"ecu": Spread.of([6 * MS] * 100)}}, "starts late: p99 6.00 ms"),
        ({"execution": BOTH.execution | {"ecu": Spread.of([7 * MS] * 100)}}, "takes too long: p99 7.00 ms"),
    ],
)
def test_each_task_is_judged_by_itself(change, named):
    timing = replace(BOTH, **change)
    assert judge_task(timing, "plant").result is Result.PASSED
    ecu = judge_task(timing, "ecu")
    assert ecu.result is Result.FAILED
    assert named in ecu.reason
    assert judge_task(replace(timing, stolen=0.1), "plant").result is Result.PASSED
    starved = judge_task(replace(timing, stolen=0.1), "ecu")
    assert starved.result is Result.INCONCLUSIVE
    assert "starved" in starved.reason
    assert named in starved.reason


@given(
    st.integers(0, 65_535),
    st.lists(st.integers(1, 9), min_size=1, max_size=30),
    st.integers(0, 3),
)
def test_reaction_is_the_time_to_the_first_echo(first, delays_ms, lost):
    """Samples every 10 ms, each echoed after its own delay and again 10 ms later; some are never answered."""
    count = len(delays_ms)
    sample_s = 0.01 * np.arange(count)
    sequence = (first + np.arange(count)) % 65_536
    kept = np.arange(count) >= lost
    answer_s = (sample_s + np.array(delays_ms) * 1e-3)[kept]
    expected = np.array(delays_ms, np.int64)[kept] * MS
    assert reaction_ns(sample_s, sequence, answer_s, sequence[kept]).tolist() == expected.tolist()


def test_a_repeated_echo_counts_once_and_an_echo_of_nothing_is_ignored():
    got = reaction_ns([0.0, 0.01], [7, 8], [-0.005, 0.004, 0.008, 0.016], [6, 7, 7, 8])
    assert got.tolist() == [4 * MS, 6 * MS]


def test_no_frames_no_reaction():
    assert reaction_ns([], [], [0.1], [1]).size == 0


def test_steal_is_a_share_of_all_processor_time(tmp_path):
    stat = tmp_path / "stat"
    stat.write_text("cpu  100 0 50 800 10 0 5 35 999 0\ncpu0 1 1\n")
    before = HostClock.read(stat)
    stat.write_text("cpu  150 0 50 840 10 0 5 45 999 0\ncpu0 1 1\n")
    assert HostClock.read(stat).stolen_since(before) == pytest.approx(10 / 100)
    assert HostClock.read(stat).busy_since(before) == pytest.approx(60 / 100)
    assert before.stolen_since(before) == 0.0


def test_this_process_has_a_waiting_time_that_never_shrinks():
    first = waited_ns()
    assert 0 <= first <= waited_ns()
