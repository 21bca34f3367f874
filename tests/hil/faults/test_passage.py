"""Laws of what faults do to the coming of frames: how many, when, in which order."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import Frame
from dbc.protection import Checker, Finding
from tests.hil.faults.traffic import DATABASE, MS, frames, injector, passed

SPEEDS = "WheelSpeedsFront"
PERIOD = 10 * MS


def findings(message, arrived):
    checker = Checker(DATABASE.by_name[message])
    return [checker.check(frame.data, at_ns) for at_ns, frame in arrived]


def test_without_faults_every_frame_passes_at_once_and_unchanged():
    sent = frames(SPEEDS, 50)
    assert passed(injector(), sent) == [(n * PERIOD, frame) for n, frame in enumerate(sent)]
    assert injector().next_ns() is None


def test_a_frame_outside_the_selection_passes_unchanged():
    sent = frames("Articulation", 50)
    tables = [
        {"kind": "drop", "message": SPEEDS},
        {"kind": "drop", "from": "ecu"},
        {"kind": "delay", "message": "WheelSpeeds", "delay_ms": 5.0},
    ]
    assert passed(injector(*tables), sent) == [(n * PERIOD, frame) for n, frame in enumerate(sent)]


@pytest.mark.parametrize("probability", [0.0, 0.03, 0.5, 1.0])
def test_the_number_of_dropped_frames_is_binomial(probability):
    """Within five standard deviations, which one seed in two million misses."""
    count = 4000
    kept = passed(
        injector({"kind": "drop", "message": SPEEDS, "probability": probability}), frames(SPEEDS, count)
    )
    spread = math.sqrt(count * probability * (1 - probability))
    assert abs(count - len(kept) - count * probability) <= 5 * spread


def test_losses_are_independent_of_one_another():
    """After a loss the next is as likely as ever: pairs of losses come p squared of the time."""
    count, p = 8000, 0.3
    sent = frames(SPEEDS, count)
    kept = {at for at, _ in passed(injector({"kind": "drop", "message": SPEEDS, "probability": p}), sent)}
    lost = [n * PERIOD not in kept for n in range(count)]
    pairs = sum(a and b for a, b in itertools.pairwise(lost))
    assert pairs == pytest.approx(count * p * p, abs=5 * math.sqrt(count * p * p))


def test_dropped_frames_are_what_the_receiver_finds_lost():
    sent = frames(SPEEDS, 200)
    arrived = passed(injector({"kind": "drop", "message": SPEEDS, "probability": 0.1}), sent)
    checker, lost = Checker(DATABASE.by_name[SPEEDS]), 0
    for at_ns, frame in arrived:
        checker.check(frame.data, at_ns)
        lost += checker.lost
    dropped_at_the_end = (len(sent) - 1) - arrived[-1][0] // PERIOD
    dropped_at_the_start = arrived[0][0] // PERIOD
    assert lost == len(sent) - len(arrived) - dropped_at_the_end - dropped_at_the_start


@given(delay_ms=st.floats(0, 500))
def test_a_delay_keeps_order_spacing_and_content(delay_ms):
    sent = frames(SPEEDS, 30)
    arrived = passed(injector({"kind": "delay", "message": SPEEDS, "delay_ms": delay_ms}), sent)
    assert arrived == [(n * PERIOD + round(delay_ms * MS), frame) for n, frame in enumerate(sent)]


@given(jitter_ms=st.floats(0, 100), seed=st.integers(0, 1000))
def test_jitter_keeps_the_order_and_its_bounds(jitter_ms, seed):
    sent = frames(SPEEDS, 40)
    arrived = passed(injector({"kind": "jitter", "message": SPEEDS, "jitter_ms": jitter_ms}, seed=seed), sent)
    assert [frame for _, frame in arrived] == sent
    assert all(0 <= at - n * PERIOD <= jitter_ms * MS + 1 for n, (at, _) in enumerate(arrived))


def test_jitter_uses_its_whole_width_evenly():
    sent = frames(SPEEDS, 4000)
    arrived = passed(injector({"kind": "jitter", "message": SPEEDS, "jitter_ms": 8.0}), sent)
    late = [at - n * PERIOD for n, (at, _) in enumerate(arrived)]
    assert sum(late) / len(late) == pytest.approx(4 * MS, rel=0.05)
    assert min(late) < 0.1 * MS
    assert max(late) > 7.9 * MS


@pytest.mark.parametrize("kind", [{"kind": "delay", "delay_ms": 35.0}, {"kind": "jitter", "jitter_ms": 60.0}])
def test_nothing_overtakes_a_delayed_frame_when_the_delay_ends(kind):
    sent = frames(SPEEDS, 40)
    arrived = passed(injector({"message": SPEEDS, "at_s": 0.1, "for_s": 0.1, **kind}), sent)
    assert [frame for _, frame in arrived] == sent
    assert arrived[-1] == (39 * PERIOD, sent[-1])
    assert set(findings(SPEEDS, arrived)) == {Finding.INITIAL, Finding.OK}


@given(depth=st.integers(1, 7), probability=st.floats(0, 1), seed=st.integers(0, 1000))
def test_reordering_is_a_permutation_and_nobody_is_overtaken_by_more_than_the_depth(depth, probability, seed):
    sent = [Frame(DATABASE.by_name[SPEEDS].can_id, bytes([n] * 8)) for n in range(60)]
    table = {"kind": "reorder", "message": SPEEDS, "depth": depth, "probability": probability}
    order = [frame.data[0] for _, frame in passed(injector(table, seed=seed), sent)]
    assert sorted(order) == list(range(60))
    for place, number in enumerate(order):
        assert sum(later > number for later in order[:place]) <= depth


def test_a_reordered_frame_comes_right_behind_the_one_that_overtook_it():
    sent = [Frame(DATABASE.by_name[SPEEDS].can_id, bytes([n] * 8)) for n in range(8)]
    arrived = passed(injector({"kind": "reorder", "message": SPEEDS}), sent)
    assert [frame.data[0] for _, frame in arrived] == [1, 0, 3, 2, 5, 4, 7, 6]
    deep = passed(injector({"kind": "reorder", "message": SPEEDS, "depth": 3}), sent)
    assert [frame.data[0] for _, frame in deep] == [1, 2, 3, 0, 5, 6, 7, 4]


def test_a_held_frame_goes_on_when_nobody_overtakes_it():
    sent = frames(SPEEDS, 1)
    assert passed(injector({"kind": "reorder", "message": SPEEDS, "depth": 2}), sent) == [
        (4 * PERIOD, sent[0])
    ]


def test_a_held_frame_goes_on_when_the_fault_ends():
    sent = frames(SPEEDS, 1)
    table = {"kind": "reorder", "message": SPEEDS, "depth": 5, "for_s": 0.02}
    assert passed(injector(table), sent) == [(20 * MS, sent[0])]


@given(copies=st.integers(1, 20), gap_ms=st.floats(0, 20))
def test_repeated_frames_are_equal_and_evenly_spaced(copies, gap_ms):
    sent = frames(SPEEDS, 1)
    table = {"kind": "repeat", "message": SPEEDS, "copies": copies, "gap_ms": gap_ms}
    arrived = passed(injector(table), sent)
    assert arrived == [(n * round(gap_ms * MS), sent[0]) for n in range(copies + 1)]


def test_the_receiver_finds_what_was_done():
    sent = frames(SPEEDS, 60)
    expected = {"repeat": Finding.REPEATED, "reorder": Finding.REORDERED}
    for kind, finding in expected.items():
        arrived = passed(injector({"kind": kind, "message": SPEEDS}), sent)
        assert finding in findings(SPEEDS, arrived)


def test_bus_off_silences_both_directions_for_its_time():
    table = {"kind": "bus_off", "node": "ecu", "at_s": 0.1, "for_s": 0.1}
    for side, message in (("plant", SPEEDS), ("ecu", "Limits")):
        sent = frames(message, 30)
        arrived = passed(injector(table), sent, side=side)
        assert [at // PERIOD for at, _ in arrived] == [*range(10), *range(20, 30)]


def test_a_babbling_node_sends_at_its_rate_and_only_while_the_fault_lasts():
    table = {"kind": "babble", "at_s": 0.1, "for_s": 0.05, "interval_us": 500.0, "from": "plant"}
    arrived = passed(injector(table), [])
    assert [at for at, _ in arrived] == [100 * MS + n * MS // 2 for n in range(100)]
    assert {frame.can_id for _, frame in arrived} == {0}
    assert len({frame.data for _, frame in arrived}) == 100


def test_who_asks_a_babbling_node_late_gets_no_flood():
    one = injector({"kind": "babble", "interval_us": 100.0})
    assert len(one.spontaneous(10_000 * MS + MS // 30)) == 64
    assert one.next_ns() == 10_000 * MS + MS // 10  # still every 100 us from the beginning


@pytest.mark.parametrize("kind", ["drop", "reorder", "corrupt", "repeat"])
def test_equal_seeds_give_equal_faults_and_others_do_not(kind):
    sent = frames(SPEEDS, 200)
    table = {"kind": kind, "message": SPEEDS, "probability": 0.5}
    assert passed(injector(table, seed=3), sent) == passed(injector(table, seed=3), sent)
    assert passed(injector(table, seed=3), sent) != passed(injector(table, seed=4), sent)


def test_two_equal_faults_draw_independently_of_each_other():
    """On two messages sent alike they do not strike alike."""
    front, rear = (
        {"kind": "drop", "message": f"WheelSpeeds{axle}", "probability": 0.5} for axle in ("Front", "Rear")
    )
    both = injector(front, rear)
    kept = [
        [bool(both.pass_frame("plant", frame, n * PERIOD)) for n, frame in enumerate(frames(message, 100))]
        for message in ("WheelSpeedsFront", "WheelSpeedsRear")
    ]
    assert kept[0] != kept[1]


def test_a_fault_keeps_its_draws_when_another_comes_after_it():
    sent = frames(SPEEDS, 200)
    one = {"kind": "drop", "message": SPEEDS, "probability": 0.5}
    other = {"kind": "drop", "message": "Articulation", "probability": 0.5}
    assert passed(injector(one), sent) == passed(injector(one, other), sent)
