"""A list of frames that came as rows is a list of frames."""

import numpy as np
import pytest

from bus.frame import EXTENDED, Frame
from bus.rows import Frames, frames_of, rows_of
from tests.bus.rows import table_of

SENT = [Frame(0x100 + k | EXTENDED * (k % 2), bytes(range(k)), 10**18 + k) for k in range(9)]


def test_rows_are_frames():
    assert frames_of(table_of(SENT)) == SENT
    np.testing.assert_array_equal(rows_of(SENT), table_of(SENT))
    assert len(rows_of([])) == 0


def made(*, look):
    """Of rows and of single frames, looked at after each addition or only at the end."""
    frames = Frames()
    for step in (
        lambda: frames.add(table_of(SENT[:3])),
        lambda: frames.append(SENT[3]),
        lambda: frames.extend(SENT[4:6]),
        lambda: frames.add(table_of(SENT[6:7])),
        lambda: frames.add(table_of(SENT[7:])),
    ):
        step()
        if look:
            assert frames[-1] == SENT[len(frames) - 1]
    return frames


@pytest.mark.parametrize("look", [True, False])
def test_order_length_and_parts_do_not_depend_on_who_looked(look):
    frames = made(look=look)
    assert len(frames) == len(SENT)
    before, tables = frames.parts()
    assert [*before, *(frame for table in tables for frame in frames_of(table))] == SENT
    assert frames == SENT
    assert (frames[2], frames[-2:], list(frames)) == (SENT[2], SENT[-2:], SENT)
    assert frames != SENT[1:]
    assert made(look=True) == made(look=False)


def test_nothing_is_made_until_somebody_looks():
    frames = Frames()
    frames.add(table_of(SENT))
    assert len(frames) == len(SENT)
    assert frames.parts()[0] == []
