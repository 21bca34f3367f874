"""Every format: what was written is read back, by us and by python-can, after every batch and wherever a kill cuts."""

import can
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.frame import BRS, ERROR, ESI, EXTENDED, FD, REMOTE, Frame
from dbc.errors import LogError
from dbc.recordings.reading import read_frames
from dbc.recordings.writer import candump_line
from hil.recording.formats import SUFFIXES, RecordingError, open_writer
from hil.recording.new_file import NewFile
from hil.recording.ring import records_of
from tests.dbc.recordings.test_reading import frame_of, plain

START_NS = 1_700_000_000_123_456_000
CHANNELS = ("front", "rear")
PAGE = 4096


@st.composite
def numbered_frames(draw):
    """Frames of every kind, whole microseconds apart."""
    at_ns, frames = START_NS, []
    for _ in range(draw(st.integers(1, 30))):
        at_ns += draw(st.integers(1, 2_000_000)) * 1000  # at one stamp MF4 keeps no order of kinds
        extended = draw(st.booleans())
        word = draw(st.integers(0, 0x1FFFFFFF)) | EXTENDED if extended else draw(st.integers(0, 0x7FF))
        kind = draw(st.sampled_from(["classic", "classic", "fd", "remote", "error"]))
        if kind == "classic":
            frames.append(Frame(word, draw(st.binary(max_size=8)), at_ns))
        elif kind == "fd":
            size = draw(st.sampled_from([1, 2, 8, 12, 48, 64]))
            flags = FD | draw(st.sampled_from([0, BRS, ESI, BRS | ESI]))
            frames.append(Frame(word, draw(st.binary(min_size=size, max_size=size)), at_ns, flags))
        elif kind == "remote":
            frames.append(Frame(word | REMOTE, bytes(draw(st.integers(0, 8))), at_ns))
        else:
            frames.append(Frame(ERROR | draw(st.integers(1, 0x1FF)), bytes(8), at_ns))
    return frames


def written(folder, suffix, batches):
    path = folder / f"a{suffix}"
    writer = open_writer(path, CHANNELS)
    for number, batch in enumerate(batches):
        writer.write(records_of(batch, number % 2))
    writer.close()
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(frames=numbered_frames(), cut=st.integers(0, 30))
@settings(deadline=None, max_examples=20)
def test_what_is_written_reads_back(tmp_path_factory, suffix, frames, cut):
    batches = [batch for batch in (frames[:cut], frames[cut:]) if batch]
    path = written(tmp_path_factory.mktemp("out"), suffix, batches)
    table = read_frames(path)
    assert table.damaged_count == 0
    assert [plain(frame) for frame in table.frames()] == [plain(frame) for frame in frames]
    numbers = [table.channels[number] for number in table.channel]
    names = CHANNELS if suffix == ".log" else ("can0", "can1")
    assert numbers == [names[k % 2] for k, batch in enumerate(batches) for _ in batch]


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(frames=numbered_frames())
@settings(deadline=None, max_examples=20)
def test_python_can_reads_what_we_write(tmp_path_factory, suffix, frames):
    if (
        suffix == ".log"
    ):  # of a candump log its reader understands neither length of remote nor most error frames
        frames = [f for f in frames if not f.can_id & (REMOTE | ERROR)] or [Frame(0x1, b"", START_NS)]
    path = written(tmp_path_factory.mktemp("out"), suffix, [frames])
    options = {"relative_timestamp": False} if suffix == ".asc" else {}
    with can.LogReader(path, **options) as reader:
        read = [plain(frame_of(message)) for message in reader]
    expected = [plain(frame) for frame in frames]
    assert read == expected


@given(frames=numbered_frames())
@settings(deadline=None, max_examples=50)
def test_a_candump_log_is_what_is_written_line_by_line(tmp_path_factory, frames):
    path = written(tmp_path_factory.mktemp("out"), ".log", [frames])
    assert path.read_text() == "".join(f"{candump_line(frame, CHANNELS[0])}\n" for frame in frames)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_is_whole_after_every_batch(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    writer = open_writer(path, CHANNELS)
    frames = [Frame(0x100 + k, k.to_bytes(8, "big"), START_NS + k * 1000) for k in range(500)]
    for first in range(0, 500, 100):
        writer.write(records_of(frames[first : first + 100]))
        table = read_frames(path)
        assert list(table.frames()) == frames[: first + 100]
        assert table.damaged_count == 0
        assert writer.size() == path.stat().st_size
    writer.close()
    assert list(read_frames(path).frames()) == frames


class Journal(NewFile):
    """Keeps every write, in order, as (offset, content, whether it ends a batch)."""

    writes: list

    def patch(self, at, content):
        self.writes.append((at, bytes(content)))
        super().patch(at, content)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_wherever_a_kill_cuts_the_batches_before_it_are_there(tmp_path, monkeypatch, suffix):
    """The file as it would be after any number of bytes handed to the kernel: whole batches stay, in order, nothing foreign.

    The kernel may be stopped between two pages of a write, so a write within one page is there or is not.
    """
    monkeypatch.setattr(Journal, "writes", [], raising=False)
    for module in ("formats", "blf", "mf4"):
        monkeypatch.setattr(f"hil.recording.{module}.NewFile", Journal)
    rng = np.random.default_rng(7)
    frames = [Frame(0x100 + k % 9, rng.bytes(8), START_NS + k * 1000) for k in range(1600)]
    writer = open_writer(tmp_path / f"whole{suffix}", CHANNELS)
    done_after = []  # writes handed over when each batch was done
    for first in range(0, 1600, 400):
        writer.write(records_of(frames[first : first + 400]))
        done_after.append(len(Journal.writes))
    writer.close()
    for _ in range(25):
        last = int(rng.integers(done_after[0], len(Journal.writes)))
        content = bytearray()
        for number, (at, piece) in enumerate(Journal.writes[: last + 1]):
            kept = 0 if at // PAGE == (at + len(piece) - 1) // PAGE else int(rng.integers(0, len(piece)))
            part = piece[:kept] if number == last else piece
            content[at : at + len(part)] = part
        path = tmp_path / f"cut{suffix}"
        path.write_bytes(content)
        found = list(read_frames(path).frames())
        batches = sum(1 for done in done_after if done <= last)
        assert found == frames[: len(found)]
        assert len(found) >= 400 * batches


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_recording_without_a_frame_is_reported(tmp_path, suffix):
    path = written(tmp_path, suffix, [])
    with pytest.raises(LogError, match=r"empty|not one frame"):
        read_frames(path)


def test_a_recording_never_replaces_a_file(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("mine")
    with pytest.raises(RecordingError, match=r"a\.log: exists"):
        open_writer(path, CHANNELS)
    assert path.read_text() == "mine"


def test_what_cannot_be_written_is_one_clear_error(tmp_path):
    for path, words in (
        (tmp_path / "a.csv", r"a\.csv: the suffix names the format, one of \.log"),
        (tmp_path / "none" / "a.blf", "cannot be written: No such file"),
    ):
        with pytest.raises(RecordingError, match=words):
            open_writer(path, CHANNELS)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_monotonic_clock_that_is_no_date(tmp_path, suffix):
    """Stamps shortly after the start of the machine: read back as they are."""
    frames = [Frame(0x1, b"\x01", 5_000_000_000), Frame(0x1, b"\x02", 5_001_000_000)]
    path = written(tmp_path, suffix, [frames])
    first, second = (frame.at_ns for frame in read_frames(path).frames())
    assert second - first == 1_000_000
    assert first == (0 if suffix == ".blf" else 5_000_000_000)  # BLF without a date begins at zero
