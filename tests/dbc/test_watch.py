"""A message watched over time: each trouble distinguished, the state machine of AUTOSAR, lateness and silence.

The frames are made by autosar-e2e itself, so that the watch is not tested against its own idea of a CRC.
"""

import pytest
from e2e.p01 import E2E_P01_DATAID_BOTH, e2e_p01_check, e2e_p01_protect
from hypothesis import given
from hypothesis import strategies as st

from dbc import loader_database
from dbc.protection import COUNTERS
from dbc.watch import SILENT, WINDOW, State, Trouble, Watch

DATABASE = loader_database()
CODEC = DATABASE.by_name["Articulation"]
OTHER = DATABASE.by_name["BodyRates"]
PLAIN = DATABASE.by_name["LiftPressure"]
CYCLE = CODEC.cycle_ns


def sent(number, codec=CODEC):
    """The frame that the sender's autosar-e2e makes as its `number`-th."""
    frame = bytearray(codec.length)
    frame[1] = number % COUNTERS
    frame[2:] = (number % 251).to_bytes(codec.length - 2, "little")
    e2e_p01_protect(frame, codec.e2e_data_id, data_id_mode=E2E_P01_DATAID_BOTH, increment_counter=False)
    return bytes(frame)


def broken(number):
    frame = bytearray(sent(number))
    frame[4] ^= 0x55
    frame[0] = 255 - frame[0]
    return bytes(frame)


def watched(count=2 * WINDOW):
    """A watch after `count` good frames, one per cycle."""
    watch = Watch(CODEC)
    for number in range(count):
        assert watch.receive(sent(number), number * CYCLE) is None
    return watch


def test_an_undisturbed_message_is_valid_from_its_first_frame_on():
    watch = Watch(CODEC)
    assert watch.state is State.NO_DATA
    for number in range(50):
        assert watch.receive(sent(number), number * CYCLE) is None
        assert watch.state is State.VALID
    assert not watch.counts


@pytest.mark.parametrize(
    ("data", "after", "trouble"),
    [
        (sent(20, OTHER), 1, Trouble.MASQUERADED),
        (sent(19), 1, Trouble.REPEATED),
        (sent(17), 1, Trouble.REORDERED),
        (sent(23), 4, Trouble.LOST),
        (sent(20), 2, Trouble.LATE),
        (sent(20)[:-1], 1, Trouble.WRONG_LENGTH),
    ],
)
def test_each_trouble_is_reported_apart(data, after, trouble):
    watch = watched()
    assert watch.receive(data, (19 + after) * CYCLE) is trouble
    assert set(watch.counts) == {trouble}


def test_a_wrong_crc_is_reported():
    watch = watched()
    found = watch.receive(broken(20), 20 * CYCLE)
    assert found in (Trouble.WRONG_CRC, Trouble.MASQUERADED)  # the CRC of one of n others fits by chance
    assert not e2e_p01_check(bytearray(broken(20)), CODEC.e2e_data_id, data_id_mode=E2E_P01_DATAID_BOTH)
    assert e2e_p01_check(bytearray(sent(20)), CODEC.e2e_data_id, data_id_mode=E2E_P01_DATAID_BOTH)


def test_a_masquerade_names_the_message_it_really_is():
    watch = watched()
    watch.receive(sent(20, OTHER), 20 * CYCLE)
    assert watch.claimed == OTHER.name


@given(st.integers(2, 14))
def test_the_frames_that_are_missing_are_counted(lost):
    watch = watched()
    watch.receive(sent(20 + lost), (20 + lost) * CYCLE)
    assert watch.counts[Trouble.LOST] == lost


@given(st.integers(0, 3 * CYCLE))
def test_late_begins_at_one_and_a_half_cycles(gap_ns):
    watch = watched()
    found = watch.receive(sent(20), 19 * CYCLE + gap_ns)
    assert (found is Trouble.LATE) == (gap_ns > 15_000_000)


def test_silence_is_reported_once_and_ends_with_the_next_frame():
    watch = watched()
    heard_ns = 19 * CYCLE
    assert watch.overdue(heard_ns + round(SILENT * CYCLE)) is None
    assert watch.overdue(heard_ns + round(SILENT * CYCLE) + 1) is Trouble.SILENT
    assert watch.overdue(heard_ns + 100 * CYCLE) is None
    assert watch.state is State.INVALID
    watch.receive(sent(20), heard_ns + 101 * CYCLE)
    assert watch.overdue(heard_ns + 110 * CYCLE) is Trouble.SILENT


def test_a_message_never_heard_is_not_silent():
    assert Watch(CODEC).overdue(10**12) is None


def test_one_bad_frame_is_borne_two_are_not_and_trust_comes_back_only_with_good_ones():
    watch = watched()
    watch.receive(broken(20), 20 * CYCLE)
    assert watch.state is State.VALID
    watch.receive(broken(21), 21 * CYCLE)
    assert watch.state is State.INVALID
    states = []
    for number in range(22, 40):
        watch.receive(sent(number), number * CYCLE)
        states.append(watch.state)
    first = states.index(State.VALID)
    assert first == WINDOW - 1  # both bad ones have left the window
    assert set(states[first:]) == {State.VALID}


def test_a_frozen_sender_becomes_invalid_though_every_frame_is_intact():
    watch = watched()
    for cycle in range(20, 40):
        watch.receive(sent(19), cycle * CYCLE)
    assert watch.state is State.INVALID
    assert watch.counts[Trouble.REPEATED] == 20


def test_lost_frames_alone_do_not_make_what_comes_invalid():
    watch = watched()
    for number in range(20, 60, 2):
        assert watch.receive(sent(number), number * CYCLE) in (None, Trouble.LOST)
        assert watch.state is State.VALID


def test_a_message_without_protection_is_judged_by_length_and_time_alone():
    watch = Watch(PLAIN)
    assert watch.receive(bytes(8), 0) is None
    assert watch.receive(bytes(8), PLAIN.cycle_ns) is None  # nothing says that it is a repetition
    assert watch.receive(bytes(7), 2 * PLAIN.cycle_ns) is Trouble.WRONG_LENGTH
    assert watch.receive(bytes(8), 5 * PLAIN.cycle_ns) is Trouble.LATE
    assert watch.overdue(9 * PLAIN.cycle_ns) is Trouble.SILENT


@given(st.lists(st.sampled_from(["good", "bad", "repeat", "skip"]), max_size=80))
def test_what_is_valid_bears_at_most_one_bad_judgement_in_its_window(events):
    """The law behind the table, for any history: two bad frames among the last ten are never valid."""
    watch, number, recent = watched(), 20, [True] * WINDOW
    for event in events:
        number += 2 if event == "skip" else 0 if event == "repeat" else 1
        bad = event == "bad"
        found = watch.receive(broken(number) if bad else sent(number), number * CYCLE)
        recent = [*recent[1:], found not in (Trouble.WRONG_CRC, Trouble.MASQUERADED)]
        if recent.count(False) > 1:
            assert watch.state is State.INVALID
