"""Laws of what faults do to the content of frames: bits, signals, and the CRC over them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import Frame
from configuration import ConfigurationError
from dbc.protection import Checker, Finding
from hil.faults.rawbits import RawSignal
from tests.hil.faults.traffic import DATABASE, frames, injector, passed, values_of

SPEEDS, SIGNED = "WheelSpeedsFront", "Articulation"
PROTECTION = ("Crc", "AliveCounter")


def ramp(n):
    return {"Left": 0.01 * n, "Right": -0.02 * n}


def through(table, sent, seed=1):
    return [frame for _, frame in passed(injector(table, seed=seed), sent)]


def findings(message, arrived):
    checker = Checker(DATABASE.by_name[message])
    return [checker.check(frame.data, n * 10_000_000) for n, frame in enumerate(arrived)]


def flipped(one, other):
    return (int.from_bytes(one.data, "little") ^ int.from_bytes(other.data, "little")).bit_count()


@given(bits=st.integers(1, 64), seed=st.integers(0, 100))
def test_corruption_flips_exactly_the_bits_asked_for(bits, seed):
    sent = frames(SPEEDS, 5, ramp)
    arrived = through({"kind": "corrupt", "message": SPEEDS, "bits": bits}, sent, seed)
    assert [flipped(a, b) for a, b in zip(sent, arrived, strict=True)] == [bits] * 5


@pytest.mark.parametrize("bits", [1, 2])
def test_a_few_flipped_bits_never_fit_the_crc(bits):
    """The generator of CRC-8 SAE J1850 is primitive: two bits closer than 255 never cancel. Three may."""
    arrived = through({"kind": "corrupt", "message": SPEEDS, "bits": bits}, frames(SPEEDS, 300, ramp))
    assert set(findings(SPEEDS, arrived)) <= {Finding.WRONG_CRC, Finding.MASQUERADED}


@given(bits=st.integers(1, 52), seed=st.integers(0, 100))
def test_corruption_with_a_valid_crc_is_only_in_the_payload(bits, seed):
    sent = frames(SPEEDS, 20, ramp)
    table = {"kind": "corrupt", "message": SPEEDS, "bits": bits, "valid_crc": True}
    arrived = through(table, sent, seed)
    assert findings(SPEEDS, arrived) == [Finding.INITIAL, *[Finding.OK] * 19]
    for before, after in zip(sent, arrived, strict=True):
        payload = int.from_bytes(before.data, "little") ^ int.from_bytes(after.data, "little")
        assert (payload >> 12).bit_count() == bits
        assert before.data[1] & 0x0F == after.data[1] & 0x0F


@pytest.mark.parametrize("content", ["zeros", "ones", "random", "any"])
def test_a_replaced_payload_with_a_valid_crc_passes_the_check(content):
    sent = frames(SPEEDS, 40, ramp)
    table = {"kind": "corrupt", "message": SPEEDS, "content": content, "valid_crc": True}
    arrived = through(table, sent)
    assert findings(SPEEDS, arrived) == [Finding.INITIAL, *[Finding.OK] * 39]
    payloads = {int.from_bytes(frame.data, "little") >> 12 for frame in arrived}
    zeros, ones = 0, (1 << 52) - 1
    assert payloads & {zeros, ones} == {"zeros": {zeros}, "ones": {ones}, "any": {zeros, ones}}.get(
        content, set()
    )
    assert (len(payloads) > 10) == (content in ("random", "any"))


def test_without_a_valid_crc_the_whole_frame_is_replaced():
    arrived = through({"kind": "corrupt", "message": SPEEDS, "content": "ones"}, frames(SPEEDS, 2, ramp))
    assert {frame.data for frame in arrived} == {b"\xff" * 8}


def test_a_number_of_bits_beside_a_whole_payload_is_refused():
    with pytest.raises(ConfigurationError, match="bits is not a known key"):
        injector({"kind": "corrupt", "message": SPEEDS, "content": "zeros", "bits": 3})


def test_an_unprotected_message_is_corrupted_anywhere():
    arrived = through(
        {"kind": "corrupt", "message": "SlopeSensor", "valid_crc": True}, frames("SlopeSensor", 400)
    )
    clean = frames("SlopeSensor", 1)[0]
    touched = 0
    for frame in arrived:
        touched |= int.from_bytes(frame.data, "little") ^ int.from_bytes(clean.data, "little")
    assert touched == 2**64 - 1


def test_freezing_holds_the_raw_bits_of_the_first_frame_and_nothing_else():
    sent = frames(SPEEDS, 40, ramp)
    table = {"kind": "freeze", "message": SPEEDS, "signal": "Left", "at_s": 0.1, "for_s": 0.2}
    arrived = through(table, sent)
    left = [values_of(frame)["Left"] for frame in arrived]
    assert left == pytest.approx([0.01 * n if not 10 <= n < 30 else 0.1 for n in range(40)])
    assert [values_of(f)["Right"] for f in arrived] == [values_of(f)["Right"] for f in sent]
    assert findings(SPEEDS, arrived) == [Finding.INITIAL, *[Finding.OK] * 39]


@given(offset=st.floats(-60, 60), angle=st.floats(-60, 60))
def test_an_offset_is_in_the_unit_of_the_signal_and_saturates_at_its_range(offset, angle):
    sent = frames(SIGNED, 3, lambda n: {"ArticulationAngle": angle})
    table = {
        "kind": "offset",
        "message": SIGNED,
        "signal": "ArticulationAngle",
        "offset": offset,
        "unit": "deg",
    }
    expected = min(max(values_of(sent[0])["ArticulationAngle"] + offset, -65.534), 65.534)
    for frame in through(table, sent):
        assert values_of(frame)["ArticulationAngle"] == pytest.approx(expected, abs=0.0011)


def test_an_offset_on_a_signal_with_a_negative_zero_point():
    """SlopeSensor angles are unsigned with an offset of -64 deg."""
    sent = frames("SlopeSensor", 1, lambda n: {"PitchAngle": 3.0})
    (frame,) = through(
        {"kind": "offset", "message": "SlopeSensor", "signal": "PitchAngle", "offset": -5.0}, sent
    )
    assert values_of(frame)["PitchAngle"] == pytest.approx(-2.0, abs=0.001)


def test_what_says_not_available_goes_on_saying_so():
    codec = DATABASE.by_name[SPEEDS]
    raw = RawSignal(codec, "Left")
    absent = Frame(codec.can_id, raw.write(frames(SPEEDS, 1)[0].data, 1 << 15))
    table = {"kind": "offset", "message": SPEEDS, "signal": "Left", "offset": 2.0}
    (frame,) = through(table, [absent])
    assert raw.to_number(raw.read(frame.data)) == -(1 << 15)


def test_spikes_come_once_in_so_many_frames():
    sent = frames(SPEEDS, 100)
    table = {"kind": "spike", "message": SPEEDS, "signal": "Left", "height": 5.0, "every": 20}
    left = [values_of(frame)["Left"] for frame in through(table, sent)]
    assert left == [5.0 if n % 20 == 0 else 0.0 for n in range(100)]


def test_swapping_exchanges_the_two_and_keeps_the_frame_sound():
    sent = frames(SPEEDS, 20, ramp)
    arrived = through({"kind": "swap", "message": SPEEDS, "signals": ["Left", "Right"]}, sent)
    for before, after in zip(sent, arrived, strict=True):
        old, new = values_of(before), values_of(after)
        assert (new["Left"], new["Right"]) == (old["Right"], old["Left"])
    assert findings(SPEEDS, arrived) == [Finding.INITIAL, *[Finding.OK] * 19]


def test_swapping_twice_is_the_identity():
    sent = frames(SPEEDS, 20, ramp)
    table = {"kind": "swap", "message": SPEEDS, "signals": ["Left", "Right"]}
    assert [frame for _, frame in passed(injector(table, table), sent)] == sent


def test_a_frame_of_the_wrong_length_is_left_alone():
    short = Frame(DATABASE.by_name[SPEEDS].can_id, b"\x01\x02\x03")
    for table in (
        {"kind": "swap", "message": SPEEDS, "signals": ["Left", "Right"]},
        {"kind": "freeze", "message": SPEEDS, "signal": "Left"},
    ):
        assert through(table, [short]) == [short]


@pytest.mark.parametrize("message", sorted(DATABASE.by_name))
def test_raw_bits_are_those_that_the_codec_reads(message):
    """Against the generated codec: raw * scale + offset for every signal; writing back changes nothing."""
    codec = DATABASE.by_name[message]
    data = bytes((37 * n + 11) % 256 for n in range(codec.length))
    for name, value in codec.decode_dict(data).items():
        raw = RawSignal(codec, name)
        number = raw.to_number(raw.read(data))
        assert number * raw.signal.scale + raw.signal.offset == value
        assert raw.write(data, raw.read(data)) == data
        assert RawSignal(codec, name).read(raw.write(data, 1)) == 1
