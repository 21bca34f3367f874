"""Compiled loops against plain Python: numbers of identifiers, rows by group, bits of signals anywhere in a frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc.kernels.groups import Numbering, rows_by_group
from dbc.kernels.unpack import fits, kind_of, plan_of, unpack
from dbc.signal import Signal


@given(st.lists(st.lists(st.integers(0, 2**32 - 1), max_size=1500), max_size=4), st.integers(0, 12))
@settings(deadline=None)
def test_identifiers_are_numbered_in_the_order_in_which_they_come(pieces, bits):
    """Over several pieces and beyond the table's first size; few bits make many equal words."""
    numbering, expected = Numbering(), {}
    for piece in pieces:
        words = [word >> (32 - bits) if bits else word for word in piece]
        found = numbering.of(np.array(words, np.uint32)).tolist()
        assert found == [expected.setdefault(word, len(expected)) for word in words]
    assert numbering.words() == list(expected)
    assert len(numbering) == len(expected)


def test_ten_thousand_identifiers_keep_apart():
    words = np.random.default_rng(1).permutation(20_000).astype(np.uint32) * np.uint32(1 << 15)
    numbering = Numbering()
    assert numbering.of(words).tolist() == list(range(20_000))
    assert numbering.of(words[::-1]).tolist() == list(range(20_000))[::-1]


@given(st.lists(st.integers(0, 4), max_size=200), st.lists(st.integers(0, 3), min_size=5, max_size=5))
@settings(deadline=None)
def test_rows_come_by_group_and_in_their_order(numbers, group_of):
    rows, begins, counts = rows_by_group(np.array(numbers, np.int32), np.array(group_of, np.int64), 3)
    for group in range(4):
        found = rows[begins[group] : begins[group + 1]].tolist()
        assert found == [row for row, number in enumerate(numbers) if group_of[number] == group]
    assert counts.tolist() == [numbers.count(number) for number in range(5)]


@st.composite
def signals(draw):
    """A signal of up to 64 bits somewhere in a message of up to 24 bytes, and the message's length."""
    length = draw(st.integers(1, 24))
    bits = draw(st.integers(1, min(64, 8 * length)))
    big = draw(st.booleans())
    first = draw(st.integers(0, 8 * length - bits))
    scale, offset = draw(st.sampled_from([(1, 0), (3, -7), (2, 0.5), (0.25, 0), (0.1, -40)]))
    start = 8 * (first // 8) + 7 - first % 8 if big else first
    return (
        Signal(
            name="s", start=start, length=bits, big_endian=big, signed=draw(st.booleans()), scale=scale, offset=offset
        ),
        length,
    )  # fmt: skip


def bits_of(data, signal):
    """The raw value bit by bit, by the DBC's numbering: least significant first (Intel), or down and on to the next byte (Motorola)."""
    at, bits = signal.start, []
    for _ in range(signal.length):
        bits.append(data[at // 8] >> (at % 8) & 1)
        at = at + 1 if not signal.big_endian else (at - 1 if at % 8 else at + 15)
    ordered = bits[::-1] if signal.big_endian else bits
    value = sum(bit << place for place, bit in enumerate(ordered))
    return value - (1 << signal.length) if signal.signed and bits and ordered[-1] else value


@given(signals(), st.data())
@settings(deadline=None, max_examples=400)
def test_a_signal_anywhere_in_a_frame_has_its_value(made, data):
    signal, length = made
    # what 64 bits cannot hold is not the kernel's
    ends = [raw * signal.scale for raw in signal.raw_limits] + [
        raw * signal.scale + signal.offset for raw in signal.raw_limits
    ]
    if not fits(signal, length) or any(not -(2**63) <= end < 2**63 for end in ends if not signal.is_identity):
        return
    frames = data.draw(st.lists(st.binary(min_size=length, max_size=length), min_size=1, max_size=3))
    assert_has_its_value(signal, length, frames)


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("bits", [1, 2, 9, 33, 63, 64])
def test_a_signal_at_every_place_of_a_frame_has_its_value(big, bits):
    """Also where just one of its bits lies in the next word."""
    length = 20
    frames = [bytes([0xFF] * length), np.random.default_rng(bits).bytes(length)]
    for first in range(8 * length - bits + 1):
        start = 8 * (first // 8) + 7 - first % 8 if big else first
        assert_has_its_value(Signal(name="s", start=start, length=bits, big_endian=big), length, frames)


def assert_has_its_value(signal, length, frames):
    # rows of which only some are the message's, with bytes behind the message
    table = np.full((2 * len(frames), 64), 0xA5, np.uint8)
    table[::2, :length] = [list(frame) for frame in frames]
    rows = np.arange(0, 2 * len(frames), 2)
    real = np.empty((2, len(frames)))
    unpack(
        table.view(np.uint64), np.arange(2 * len(frames)) * 10**9, rows, length, *plan_of([signal], length),
        real.view(np.int64), real,
    )  # fmt: skip
    raw = [bits_of(frame, signal) for frame in frames]
    expected = raw if signal.is_identity else [value * signal.scale + signal.offset for value in raw]
    assert real[1].view(kind_of(signal)).tolist() == expected
    assert real[0].tolist() == rows.tolist()
