"""One recording in one or many files: nothing lost between them, each within its bound."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.frame import Frame
from dbc.recordings.reading import read_frames
from hil.recording.files import Plan, RecordingFiles, names_of
from hil.recording.ring import records_of

MS = 1_000_000


def recorded(plan, batches):
    files = RecordingFiles(plan)
    for batch in batches:
        files.write(records_of(batch))
    files.close()
    return files


@given(st.lists(st.integers(0, 400), min_size=1, max_size=60), st.integers(1, 20))
@settings(deadline=None, max_examples=40)
def test_by_time_each_file_is_shorter_than_its_bound_and_as_long_as_can_be(tmp_path_factory, gaps_ms, size):
    stamps = (np.cumsum(gaps_ms) * MS).tolist()
    frames = [Frame(k, b"", at) for k, at in enumerate(stamps)]
    plan = Plan(path=tmp_path_factory.mktemp("out") / "a.log", channels=("can0",), rotate_ns=500 * MS)
    files = recorded(plan, [frames[k : k + size] for k in range(0, len(frames), size)])
    parts = [list(read_frames(path).frames()) for path in files.paths]
    assert [frame for part in parts for frame in part] == frames
    assert all(part[-1].at_ns - part[0].at_ns < 500 * MS for part in parts)
    for part, following in pairwise(parts):
        assert following[0].at_ns - part[0].at_ns >= 500 * MS


def test_by_size_a_new_file_begins_after_the_batch_that_exceeds(tmp_path):
    frames = [Frame(k, bytes(8), k * MS) for k in range(100)]
    plan = Plan(path=tmp_path / "a.log", channels=("can0",), rotate_bytes=1000)
    files = recorded(plan, [frames[k : k + 10] for k in range(0, 100, 10)])
    assert [path.name for path in files.paths] == [f"a-{n:03d}.log" for n in range(1, len(files.paths) + 1)]
    line = len("(0000000000.000000) can0 000#0000000000000000\n")
    assert [path.stat().st_size for path in files.paths[:-1]] == [
        30 * line
    ] * 3  # the first ten beyond 1000 bytes
    assert [f for path in files.paths for f in read_frames(path).frames()] == frames
    assert names_of(files.paths) == f"{tmp_path / 'a-001.log'} .. a-004.log (4 files)"


def test_several_buses_are_put_in_the_order_of_their_stamps(tmp_path):
    files = RecordingFiles(Plan(path=tmp_path / "a.log", channels=("one", "two")))
    one = records_of([Frame(1, b"", at) for at in (1000, 3000, 5000)], 0)
    two = records_of([Frame(2, b"", at) for at in (2000, 3000, 4000)], 1)
    files.write(np.concatenate((one, two)))
    files.close()
    read = list(read_frames(tmp_path / "a.log").frames())
    assert [(frame.at_ns // 1000, frame.can_id) for frame in read] == [
        (1, 1), (2, 2), (3, 1), (3, 2), (4, 2), (5, 1),
    ]  # fmt: skip


@pytest.mark.parametrize("suffix", [".log", ".blf", ".asc", ".mf4"])
def test_stamps_are_whole_microseconds_of_the_files_clock(tmp_path, suffix):
    plan = Plan(path=tmp_path / f"a{suffix}", channels=("can0",), offset_ns=1_700_000_000_000_000_000)
    recorded(plan, [[Frame(1, b"", 1_999), Frame(1, b"", 2_000)]])
    assert [frame.at_ns - plan.offset_ns for frame in read_frames(plan.path).frames()] == [1000, 2000]
