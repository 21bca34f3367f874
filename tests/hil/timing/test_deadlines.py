"""Deadlines: every kind of miss is counted exactly, silence counts, and doubt is never a pass."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.timing.deadlines import MessageJudge, Observation, Observer, judge_message, overall
from hil.verdict import Result

MS = 1_000_000
PERIOD = 10 * MS
FRAMES = 100
OBSERVER = Observer(start_ns=0, end_ns=FRAMES * PERIOD)


def observation(at_ns, counters=None, same=None, period=PERIOD):
    return Observation(
        name="Articulation",
        period_ns=period,
        at_ns=np.asarray(at_ns, np.int64),
        counters=None if counters is None else np.asarray(counters, np.int64),
        same_payload=None if same is None else np.asarray(same, bool),
    )


def punctual():
    at = np.arange(FRAMES) * PERIOD + 3 * MS
    return at, np.arange(FRAMES) % 15


def test_a_punctual_message_passes():
    at, counters = punctual()
    verdict = judge_message(observation(at, counters), OBSERVER)
    assert verdict.result is Result.PASSED
    assert (verdict.late, verdict.early, verdict.missing, verdict.duplicates, verdict.counter_jumps) == (
        0,
    ) * 5
    assert verdict.stale_share == 0
    assert verdict.median_gap_ns == PERIOD


@given(st.lists(st.integers(-4 * MS, 4 * MS), min_size=FRAMES, max_size=FRAMES))
def test_jitter_below_the_tolerance_never_fails(jitter):
    """A gap differs from the period by at most the difference of two jitters: halve it to stay inside."""
    at, counters = punctual()
    verdict = judge_message(observation(at + np.asarray(jitter) // 2, counters), OBSERVER)
    assert verdict.result is Result.PASSED, verdict.reason


@given(first=st.integers(1, FRAMES - 2), count=st.integers(1, 30))
def test_every_missing_frame_is_counted_once(first, count):
    at, counters = punctual()
    gone = slice(first, min(first + count, FRAMES - 1))
    kept = np.delete(np.arange(FRAMES), gone)
    verdict = judge_message(observation(at[kept], counters[kept]), OBSERVER)
    lost = FRAMES - kept.size
    assert verdict.missing == lost
    assert verdict.late == 1
    assert verdict.result is Result.FAILED
    # The counter knows the step modulo 15 only; with the time between the frames it is exact.
    assert verdict.lost_frames == lost
    assert (verdict.counter_jumps, verdict.duplicates) == (1, 0)


def test_silence_at_either_end_counts():
    at, counters = punctual()
    ended = judge_message(observation(at[:50], counters[:50]), OBSERVER)
    begun = judge_message(observation(at[50:], counters[50:]), OBSERVER)
    assert ended.missing == begun.missing == 50
    assert ended.result is begun.result is Result.FAILED
    # Stale after three periods: 50 of 100 periods are silent, some 47 of them too long.
    assert ended.stale_share == pytest.approx(0.475, abs=0.01)


def test_a_message_that_never_came_fails():
    verdict = judge_message(observation([]), OBSERVER)
    assert verdict.result is Result.FAILED
    assert verdict.missing == FRAMES


def test_late_and_early_are_reported_apart():
    at, counters = punctual()
    at[10] += 6 * MS  # gap before 16 ms, gap after 4 ms
    verdict = judge_message(observation(at, counters), OBSERVER)
    assert (verdict.late, verdict.early, verdict.missing) == (1, 1, 0)
    assert verdict.worst_gap_ns == 16 * MS
    assert verdict.worst_at_ns == at[9]


@given(first=st.integers(1, FRAMES - 8), count=st.integers(1, 4), delay=st.integers(6, 9))
def test_a_delayed_frame_after_lost_ones_is_not_missing(first, count, delay):
    at, counters = punctual()
    kept = np.delete(np.arange(FRAMES), slice(first, first + count))
    at = at[kept]
    at[first] += delay * MS
    verdict = judge_message(observation(at, counters[kept]), OBSERVER)
    assert (verdict.missing, verdict.late, verdict.early) == (count, 1, 1)


def test_a_repeated_frame_is_a_duplicate_and_a_changed_one_a_jump():
    at, counters = punctual()
    counters[20] = counters[19]
    same = np.zeros(FRAMES, bool)
    same[20] = True
    repeated = judge_message(observation(at, counters, same), OBSERVER)
    assert (repeated.duplicates, repeated.counter_jumps) == (1, 1)  # the step after it skips one
    frozen = judge_message(observation(at, counters, np.zeros(FRAMES, bool)), OBSERVER)
    assert (frozen.duplicates, frozen.counter_jumps) == (0, 2)


def test_a_counter_outside_its_range_is_a_jump():
    at, counters = punctual()
    counters[29] = 15  # 28, 29 -> counts 13, 14; 15 is never sent
    assert judge_message(observation(at, counters), OBSERVER).counter_jumps >= 1


def test_stamps_that_run_backwards_fail():
    at, counters = punctual()
    at[40], at[41] = at[41], at[40]
    verdict = judge_message(observation(at, counters), OBSERVER)
    assert verdict.backwards == 1
    assert verdict.result is Result.FAILED


@pytest.mark.parametrize(
    ("doubt", "word"),
    [
        ({"lost": 3}, "lost 3 frames"),
        ({"unfinished": True}, "cut off"),
    ],
)
def test_doubt_is_never_a_pass_nor_a_failure(doubt, word):
    at, counters = punctual()
    for stamps in (at, at[:50]):
        verdict = judge_message(observation(stamps, counters[: stamps.size]), replace(OBSERVER, **doubt))
        assert verdict.result is Result.INCONCLUSIVE
        assert word in verdict.reason


def test_a_starved_host_excuses_what_was_late_and_nothing_else():
    at, counters = punctual()
    starved = replace(OBSERVER, starved="12 % of processor time went to other guests")
    assert judge_message(observation(at, counters), starved).result is Result.PASSED
    late = judge_message(observation(at[:50], counters[:50]), starved)
    assert late.result is Result.INCONCLUSIVE
    assert "starved: 12 %" in late.reason


STARVED = replace(OBSERVER, starved="12 %", starved_moment="plant waited 40 ms", waits={"": {}})


@pytest.mark.parametrize("wrong", ["two senders", "repeated", "backwards"])
def test_no_busy_host_explains_a_second_sender_a_repeat_or_a_wrong_order(wrong):
    at, counters = punctual()
    same = np.zeros(FRAMES, bool)
    if wrong == "two senders":
        counters[1::2] = (counters[1::2] + 7) % 15
    elif wrong == "repeated":
        counters[20], same[20] = counters[19], True
    else:
        at[40], at[41] = at[41], at[40]
    at[60:] += 2 * PERIOD  # something is late beside it
    verdict = judge_message(observation(at, counters, same), STARVED)
    assert verdict.result is Result.FAILED, verdict.reason


def test_a_sender_that_pauses_for_a_turn_of_the_counter_was_only_late():
    """Twenty periods with one step of the counter: nothing was lost if the sender was kept waiting meanwhile."""
    at, counters = punctual()
    at[60:] += 20 * PERIOD
    observer = replace(STARVED, end_ns=STARVED.end_ns + 20 * PERIOD)
    verdict = judge_message(observation(at, counters), observer)
    assert (verdict.counter_jumps, verdict.counter_errors) == (1, 0)
    assert verdict.result is Result.INCONCLUSIVE
    assert (
        judge_message(observation(at, counters), replace(observer, starved="", starved_moment="")).result
        is Result.FAILED
    )


def test_a_counter_jumps_where_the_starved_bench_itself_dropped_frames():
    at, counters = punctual()
    kept = np.delete(np.arange(FRAMES), slice(30, 33))
    lacking = observation(at[kept], counters[kept])
    assert judge_message(lacking, STARVED).result is Result.FAILED
    assert judge_message(lacking, replace(STARVED, dropped=3)).result is Result.INCONCLUSIVE


def test_without_a_period_or_a_window_nothing_is_judged():
    at, _ = punctual()
    assert judge_message(observation(at, period=None), OBSERVER).result is Result.INCONCLUSIVE
    short = Observer(start_ns=0, end_ns=2 * PERIOD)
    assert judge_message(observation(at[:2]), short).result is Result.INCONCLUSIVE


def test_the_worst_verdict_decides():
    at, counters = punctual()
    good = judge_message(observation(at, counters), OBSERVER)
    bad = judge_message(observation(at[:50]), OBSERVER)
    open_ = judge_message(observation(at, period=None), OBSERVER)
    assert overall([good]).result is Result.PASSED
    assert overall([good, open_]).result is Result.INCONCLUSIVE
    assert overall([good, open_, bad]).result is Result.FAILED
    assert overall([]).result is Result.INCONCLUSIVE


@given(
    gaps=st.lists(st.integers(-5 * MS, 60 * MS), min_size=1, max_size=60),
    steps=st.lists(st.integers(0, 15), min_size=60, max_size=60),
    same=st.lists(st.booleans(), min_size=61, max_size=61),
    cuts=st.lists(st.integers(0, 61), max_size=8),
)
def test_frames_taken_in_pieces_give_the_verdict_on_all(gaps, steps, same, cuts):
    at = np.concatenate(([3 * MS], 3 * MS + np.cumsum(gaps)))
    counters = np.concatenate(([0], np.cumsum(steps)[: len(gaps)])) % 16  # 15 among them, which is never sent
    seen = observation(at, counters, same[: at.size])
    window = Observer(start_ns=int(at.min()) - 40 * MS, end_ns=int(at.max()) + 40 * MS)
    judge = MessageJudge(PERIOD)
    for begin, end in pairwise([0, *sorted(min(cut, at.size) for cut in cuts), at.size]):
        judge.add(seen.at_ns[begin:end], seen.counters[begin:end], seen.same_payload[begin:end])
    assert judge.verdict(seen.name, window) == judge_message(seen, window)
