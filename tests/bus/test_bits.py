"""The length of a frame on the wire: laws of ISO 11898-1 and published bounds."""

from hypothesis import given
from hypothesis import strategies as st

from bus.bits import CLASSIC_TAIL, CRC15, classic_bits, crc15, duration_ns, fd_lengths, stuffed
from bus.frame import BRS, ERROR, EXTENDED, FD, REMOTE, Frame
from tests.bus.laws import classic, fd, remote

bit_texts = st.text("01", max_size=200)


def destuffed(bits: str) -> str:
    """What a receiver makes of the bits: after five equal ones the next is thrown away."""
    kept = ""
    run, previous, skip = 0, "", False
    for bit in bits:
        if skip:
            assert bit != previous, "six equal bits: a stuff error"
            run, previous, skip = 1, bit, False
            continue
        run = run + 1 if bit == previous else 1
        previous = bit
        kept += bit
        skip = run == 5
    return kept


@given(bit_texts)
def test_a_receiver_recovers_what_was_stuffed(bits: str) -> None:
    assert destuffed(stuffed(bits)) == bits


@given(bit_texts)
def test_bits_with_their_crc_are_divisible_by_the_generator(bits: str) -> None:
    word = int("1" + bits, 2) << 15 | crc15("1" + bits)
    while word.bit_length() > 15:
        word ^= CRC15 << (word.bit_length() - 16)
    assert word == 0


@given(classic)
def test_lengths_keep_within_the_published_bounds(frame: Frame) -> None:
    """Davis, Burns, Bril, Lukkien: Controller Area Network schedulability analysis, 2007, equation 1."""
    g, s = (54 if frame.can_id & EXTENDED else 34), len(frame.data)
    bits = duration_ns(frame, 1_000_000) // 1000
    assert g + 8 * s + 13 <= bits <= g + 8 * s + 13 + (g + 8 * s - 1) // 4


def test_the_shortest_and_the_longest_standard_frame_with_eight_bytes() -> None:
    """111 bits without stuffing, at most 135 with it (same source); 0x55... needs hardly any."""
    assert len(classic_bits(Frame(0x555, b"\x55" * 8))) + CLASSIC_TAIL == 111
    longest = max(
        duration_ns(Frame(0x7F0 ^ bits, b"\xf8\x78\x78\x78\x78\x78\x78\x78"), 10**6) for bits in range(256)
    )
    assert 128_000 <= longest <= 135_000


def test_a_remote_frame_is_as_long_as_one_without_data() -> None:
    assert len(classic_bits(Frame(REMOTE | 5, bytes(8)))) == len(classic_bits(Frame(5, b"")))


@given(remote)
def test_the_duration_is_inverse_to_the_bit_rate(frame: Frame) -> None:
    assert duration_ns(frame, 250_000) == 4 * duration_ns(frame, 1_000_000)


@given(fd, st.integers(1, 8))
def test_only_the_data_phase_of_a_switched_frame_is_faster(frame: Frame, factor: int) -> None:
    slow, fast = fd_lengths(frame)
    plain = duration_ns(frame, 1_000_000)
    assert plain == (slow + fast) * 1000
    switched = duration_ns(frame, 1_000_000, factor * 1_000_000)
    expected = slow * 1000 + fast * 1000 / (factor if frame.flags & BRS else 1)
    assert abs(switched - expected) <= 1


def test_fd_lengths_counted_by_hand() -> None:
    """Bits chosen so that nothing is stuffed before the CRC field.

    Standard, 0 bytes: SOF 1, id 11, RRS, IDE, FDF, res, BRS = 17; then 12 after the CRC delimiter.
    Data phase: ESI 1, DLC 4, stuff count 4, CRC 17, six fixed stuff bits, delimiter 1 = 33; 16 bytes add 128,
    and 64 bytes 512 with four more CRC bits and one more fixed stuff bit.
    """
    assert fd_lengths(Frame(0x555, b"", 0, FD | BRS)) == (29, 33)
    assert fd_lengths(Frame(0x555, b"\x55" * 16, 0, FD | BRS)) == (29, 33 + 128)
    assert fd_lengths(Frame(0x555, b"\x55" * 64, 0, FD | BRS)) == (29, 33 + 512 + 5)
    assert fd_lengths(Frame(EXTENDED | 0x15555555, b"", 0, FD | BRS)) == (29 + 19, 33)


def test_an_error_frame_takes_its_flag_and_delimiter() -> None:
    assert duration_ns(Frame(ERROR, bytes(8)), 1_000_000) == 17_000
