"""Contents of frames: the compiled check of profile 1 against the e2e package, and counts of pieces against the whole."""

import numpy as np
import pytest
from e2e.p01 import e2e_p01_protect
from hypothesis import given
from hypothesis import strategies as st

from dbc import loader_database
from dbc.kernels.checksums import COUNTER_NEVER_SENT, INTACT, WRONG_CRC, check_profile1
from dbc.protections import MODES, Profile1
from dbc.recordings.logfile import FrameTable
from dbc.tally.contents import ContentsCount, not_in_table, outside_range
from dbc.tally.payloads import LastPayload

DATABASE = loader_database()


@given(
    data_id=st.integers(0, 0xFFFF),
    mode=st.sampled_from(sorted(MODES)),
    frames=st.lists(st.binary(min_size=8, max_size=8), min_size=1, max_size=20),
    damage=st.integers(0, 255),
)
def test_each_frame_is_what_the_e2e_package_says(data_id, mode, frames, damage):
    expected, rows = [], []
    for frame in frames:
        signed = bytearray(frame)
        e2e_p01_protect(signed, data_id, data_id_mode=MODES[mode], increment_counter=False)
        rows.append(bytes(signed))
        expected.append(COUNTER_NEVER_SENT if signed[1] & 0x0F == 15 else INTACT)
        rows.append(bytes([signed[0] ^ damage, *signed[1:]]))
        expected.append(expected[-1] if damage == 0 else WRONG_CRC)
    data = np.array([list(row) for row in rows], np.uint8)
    order = np.arange(len(rows))[::-1].copy()
    found = check_profile1(Profile1(data_id, mode), data, order, 8)
    assert found.tolist() == expected[::-1]


def random_table(name, count, *, width=8):
    """Random payloads of one message: with nearly every CRC wrong, some lengths too, and equal neighbours."""
    codec, rng = DATABASE.by_name[name], np.random.default_rng(3)
    data = np.zeros((count, width), np.uint8)
    data[:, : codec.length] = rng.integers(0, 256, (count, codec.length))
    if codec.profile is not None:
        for row in range(0, count, 2):
            signed = bytearray(data[row, : codec.length].tobytes())
            codec.profile.sign(signed)
            data[row, : codec.length] = list(signed)
    data[1::5] = data[0::5][: data[1::5].shape[0]]
    length = np.full(count, codec.length, np.uint8)
    length[::7] = codec.length - 1
    return FrameTable(
        time_ns=np.arange(count, dtype=np.int64),
        can_id=np.full(count, codec.can_id, np.uint32),
        length=length,
        flags=np.zeros(count, np.uint8),
        data=data,
        channel=np.zeros(count, np.uint8),
        channels=("can0",),
    )


@pytest.mark.parametrize("name", sorted(DATABASE.by_name))
def test_the_counts_are_those_of_each_frame_by_itself(name):
    """Rows one by one, through the codec for one frame, and the rules of a signal on each value."""
    codec, table = DATABASE.by_name[name], random_table(name, 210)
    count = ContentsCount(codec)
    for rows in np.array_split(np.arange(len(table)), 4):
        count.add(table, rows)
    found = count.counted(name, "can0")
    lengths = crcs = counters = 0
    bad = dict.fromkeys(codec.signals, 0)
    for frame in table.frames():
        if len(frame.data) != codec.length:
            lengths += 1
            continue
        if codec.profile is not None:
            if not codec.profile.intact(frame.data):
                crcs += 1
                continue
            counters += codec.profile.counter(frame.data) == 15
        for signal, value in codec.decode_dict(frame.data).items():
            values = np.array([value], float)
            broken = outside_range(codec.by_signal[signal], values) | not_in_table(
                codec.by_signal[signal], values
            )
            bad[signal] += int(broken[0])
    assert (found.frames, found.wrong_length, found.wrong_crc, found.wrong_counter) == (
        210,
        lengths,
        crcs,
        counters,
    )
    assert found.outside | found.undefined == {signal: times for signal, times in bad.items() if times}


def test_equal_payloads_are_seen_across_pieces_of_different_width():
    narrow, wide = random_table("Limits", 20), random_table("Limits", 20, width=64)
    rows = np.arange(20)
    expected = [False] + [narrow.data[k].tobytes() == narrow.data[k - 1].tobytes() for k in range(1, 20)]
    assert any(expected)
    payload = LastPayload()
    found = [
        *payload.same(narrow, rows[:6]),
        *payload.same(wide, rows[6:11]),
        *payload.same(narrow, rows[11:]),
    ]
    assert found == expected
