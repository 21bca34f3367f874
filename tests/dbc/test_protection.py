"""End-to-end protection: the CRC against AUTOSAR's definition, and every fault class distinguished."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc import loader_database
from dbc.protection import Checker, Finding, Protector
from dbc.protections import MODES, Profile1

ARTICULATION = loader_database().by_name["Articulation"]
CYCLE = ARTICULATION.cycle_ns
PAYLOAD = bytes.fromhex("0000112233445566")
PROTECTED = [codec for codec in loader_database().by_name.values() if codec.e2e_data_id is not None]


def crc8(data, *, start):
    """CRC-8 with the polynomial of SAE J1850, 0x1D, bit by bit."""
    crc = start
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D if crc & 0x80 else crc << 1) & 0xFF
    return crc


def profile_1(data_id, data):
    """CRC of E2E profile 1, data id mode BOTH: over the id's low byte, its high byte, then all but the CRC byte.

    It starts at 0 and ends uninverted, which the profile reaches by undoing the library's start and end values.
    """
    return crc8(bytes([data_id & 0xFF, data_id >> 8]) + data[1:], start=0)


def sent(count, codec=ARTICULATION, counter=0):
    protector = Protector(codec, counter)
    return [protector.protect(PAYLOAD) for _ in range(count)]


def findings(frames, codec=ARTICULATION, gap_ns=CYCLE):
    """Checked one cycle apart."""
    checker = Checker(codec)
    return [checker.check(frame, i * gap_ns) for i, frame in enumerate(frames)]


def test_the_check_polynomial_against_its_published_value():
    """AUTOSAR SWS CRC Library, CRC-8 SAE J1850: start 0xFF, inverted at the end; "123456789" gives 0x4B."""
    assert crc8(b"123456789", start=0xFF) ^ 0xFF == 0x4B


@given(st.sampled_from(PROTECTED), st.binary(min_size=8, max_size=8), st.integers(0, 14))
def test_crc_and_counter_against_the_definition(codec, data, counter):
    frame = Protector(codec, counter).protect(data)
    assert frame[0] == profile_1(codec.e2e_data_id, frame)
    assert frame[1] == data[1] & 0xF0 | counter
    assert frame[2:] == data[2:]


def test_the_counter_runs_from_0_to_14_and_round():
    assert [frame[1] & 0x0F for frame in sent(32)] == [*range(15), *range(15), 0, 1]


def test_an_undisturbed_stream_is_ok_after_its_first_frame():
    assert findings(sent(50)) == [Finding.INITIAL, *[Finding.OK] * 49]


@given(st.integers(1, 14), st.integers(0, 63))
def test_every_single_bit_error_is_found(first, bit):
    frames = sent(first + 1)
    broken = bytearray(frames[first])
    broken[bit // 8] ^= 1 << bit % 8
    found = findings([*frames[:first], bytes(broken)])[-1]
    assert found in (Finding.WRONG_CRC, Finding.MASQUERADED)
    assert not found.usable


@given(st.sampled_from(PROTECTED))
def test_a_frame_of_another_message_is_a_masquerade_and_named(other):
    checker = Checker(ARTICULATION)
    checker.check(sent(1)[0], 0)
    found = checker.check(sent(1, codec=other, counter=1)[0], CYCLE)
    if other is ARTICULATION:
        assert found is Finding.OK
    else:
        assert found is Finding.MASQUERADED
        assert checker.claimed == other.name


def test_no_two_data_ids_share_their_crc():
    """The CRC is linear: two ids that give one frame the same CRC do so for every frame."""
    crcs = {codec.name: profile_1(codec.e2e_data_id, PAYLOAD) for codec in PROTECTED}
    assert len(set(crcs.values())) == len(crcs)


@pytest.mark.parametrize("lost", range(1, 40))
def test_lost_frames_are_counted_with_the_help_of_the_clock(lost):
    """The counter goes round every 15 frames; how often, the time since the last frame says."""
    frames = sent(lost + 3)
    checker = Checker(ARTICULATION)
    assert checker.check(frames[0], 0) is Finding.INITIAL
    assert checker.check(frames[1], CYCLE) is Finding.OK
    found = checker.check(frames[lost + 2], (lost + 2) * CYCLE)
    assert found is Finding.LOST
    assert found.usable
    assert checker.lost == lost


@pytest.mark.parametrize("pause", [2, 5, 9, 12, 40])
def test_a_sender_that_paused_has_lost_nothing(pause):
    """Its counter goes on where it was; only a pause of whole turns of the counter looks like a loss."""
    a, b = sent(2)
    checker = Checker(ARTICULATION)
    checker.check(a, 0)
    assert checker.check(b, pause * CYCLE) is Finding.OK


def test_late_and_bunched_frames_are_not_lost_frames():
    frames = sent(20)
    checker = Checker(ARTICULATION)
    stamps = [0, *[3 * CYCLE] * 3, *range(4 * CYCLE, 20 * CYCLE, CYCLE)]
    assert [checker.check(f, at) for f, at in zip(frames, stamps, strict=True)][1:] == [Finding.OK] * 19


def test_a_frozen_sender_repeats_however_long():
    frames = sent(3)
    assert findings([*frames, *[frames[2]] * 40])[3:] == [Finding.REPEATED] * 40


def test_a_frame_overtaken_by_the_next_ones_is_reordered_and_not_used():
    """1, 2, 4, 3, 5: frame 3 seems lost when 4 comes, arrives right behind it, and 5 goes on from 4."""
    a, b, c, d, e = sent(5)
    checker = Checker(ARTICULATION)
    stamps = [0, CYCLE, 3 * CYCLE, 3 * CYCLE + 200_000, 4 * CYCLE]
    found = [checker.check(f, at) for f, at in zip((a, b, d, c, e), stamps, strict=True)]
    assert found == [Finding.INITIAL, Finding.OK, Finding.LOST, Finding.REORDERED, Finding.OK]


def test_two_frames_overtaken_together_are_both_reordered():
    a, b, c, d, e = sent(5)
    checker = Checker(ARTICULATION)
    stamps = [0, 3 * CYCLE, 3 * CYCLE + 200_000, 3 * CYCLE + 400_000, 4 * CYCLE]
    found = [checker.check(f, at) for f, at in zip((a, d, b, c, e), stamps, strict=True)]
    assert found == [Finding.INITIAL, Finding.LOST, Finding.REORDERED, Finding.REORDERED, Finding.OK]


@given(st.integers(1, 30))
def test_a_restarted_sender_is_accepted_again_within_two_frames(before):
    """Its counter begins at 0. The step back or ahead is reported once; at the second frame the stream goes on."""
    found = findings([*sent(before), *sent(10)])
    assert found[before] is not Finding.WRONG_CRC
    assert found[before + 1].usable
    assert found[before + 2 :] == [Finding.OK] * 8


def test_what_a_broken_frame_hides_counts_as_lost():
    frames = sent(4)
    broken = bytes([frames[2][0] ^ 0x55]) + frames[2][1:]
    checker = Checker(ARTICULATION)
    found = [checker.check(f, i * CYCLE) for i, f in enumerate([*frames[:2], broken, frames[3]])]
    assert found[2:] == [found[2], Finding.LOST]
    assert not found[2].usable
    assert checker.lost == 1


def test_counter_15_and_a_wrong_length_are_reported():
    frame = bytearray(sent(1)[0])
    frame[1] |= 0x0F
    frame[0] = profile_1(ARTICULATION.e2e_data_id, bytes(frame))
    assert findings([bytes(frame)]) == [Finding.WRONG_COUNTER]
    assert findings([frame[:7], b"", bytes(9)]) == [Finding.WRONG_LENGTH] * 3


def test_only_intact_and_new_frames_are_usable():
    assert {finding for finding in Finding if finding.usable} == {
        Finding.OK,
        Finding.INITIAL,
        Finding.LOST,
        Finding.RESTARTED,
    }


def test_a_message_without_protection_is_refused():
    for side in (Protector, Checker):
        with pytest.raises(ValueError, match="LiftPressure carries no end-to-end protection"):
            side(loader_database().by_name["LiftPressure"])


def definition(mode, data_id, frame):
    """CRC of profile 1 in each data id mode (AUTOSAR PRS_E2EProtocol, E2E_P01DataIDMode), from the CRC alone."""
    low, high = data_id & 0xFF, data_id >> 8
    counter = frame[1] & 0x0F
    first = {
        "both": [low, high],
        "low": [low],
        "alternating": [low if counter % 2 == 0 else high],
        "nibble": [low, 0],
    }[mode]
    return crc8(bytes(first) + frame[1:], start=0)


@given(
    st.sampled_from(sorted(MODES)),
    st.integers(0, 0x0FFF),
    st.binary(min_size=8, max_size=8),
    st.integers(0, 14),
)
def test_every_data_id_mode_against_its_definition(mode, data_id, data, counter):
    profile = Profile1(data_id, mode)
    frame = profile.protect(data, counter)
    assert frame[0] == definition(mode, data_id, frame)
    assert profile.intact(frame)
    assert profile.counter(frame) == counter
    assert frame[2:] == data[2:]
    if mode == "nibble":
        assert frame[1] >> 4 == data_id >> 8
    else:
        assert frame[1] >> 4 == data[1] >> 4


def test_a_receiver_in_another_mode_finds_a_wrong_crc():
    frame = Profile1(0x0123, "low").protect(PAYLOAD, 3)
    assert not Profile1(0x0123, "both").intact(frame)


def test_a_mode_that_is_none_is_refused():
    with pytest.raises(ValueError, match="none of both, alternating, low, nibble"):
        Profile1(1, "high")
