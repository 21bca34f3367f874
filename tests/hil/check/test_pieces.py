"""A recording checked piece by piece gives the verdicts of the whole, in memory that does not grow."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from bus.frame import ERROR, EXTENDED, Frame
from dbc import FOLDER, loader_database
from dbc.database import Database
from dbc.recordings import logfile, reading
from dbc.recordings.part import Part, WrongPartError
from dbc.recordings.writer import candump_line
from dbc.tally import median
from hil.check.check import RecordingJudge, check
from hil.check.observed import Observed, check_observed, observed
from hil.compose import lockstep
from hil.timing.deadlines import Observer
from plant.unit.scenario import load_scenario
from studies.campaigns.memory import table_of

DATABASES = [loader_database(), Database.from_file(FOLDER / "reference.dbc")]


@pytest.fixture(scope="module")
def frames():
    """Three seconds of a drive with every kind of fault: lost, repeated, late, cut and changed frames, two channels' worth."""
    made = lockstep(load_scenario("loaded"), reference=True)
    for _ in range(300):
        made.step()
    every = sorted((*made.recording.bus, *made.recording.reference), key=lambda frame: frame.at_ns)
    rng = np.random.default_rng(2)
    for place in rng.choice(len(every), 150, replace=False).tolist():
        frame = every[place]
        data = bytearray(frame.data)
        data[-1] ^= 0x55
        every[place] = [
            frame._replace(data=bytes(data)),
            frame._replace(at_ns=frame.at_ns + 7_000_000),
            frame._replace(data=frame.data[:-1]),
            frame._replace(can_id=0x123 | EXTENDED),
            Frame(ERROR | 4, bytes(8), frame.at_ns),
        ][place % 5]
    repeated = [frame for place, frame in enumerate(every) for _ in range(1 + (place % 97 == 0))]
    return [frame for place, frame in enumerate(repeated) if place % 211]


@pytest.fixture
def log(frames, tmp_path):
    """The frames on two channels, with damaged lines, and cut off within the last line."""
    file = tmp_path / "drive.log"
    lines = [f"{candump_line(frame, f'can{frame.can_id % 3 == 0:d}')}\n" for frame in frames]
    lines[100:100] = ["no frame\n"]
    file.write_text("".join(lines) + "(12.0000")
    return file


@pytest.fixture(params=[2_000, 50_000])
def small_pieces(request, monkeypatch):
    """A log is read in pieces of so many bytes."""
    monkeypatch.setattr(logfile, "LONGEST_LINE", 200)
    monkeypatch.setattr(logfile, "PIECE", request.param)


@pytest.mark.parametrize(
    "part",
    [
        Part(),
        Part(channel="can1"),
        Part(from_s=0.5),
        Part(to_s=2.5),
        Part(from_s=0.5, to_s=1.5, channel="can0"),
    ],
)
def test_pieces_give_the_verdicts_of_the_whole(log, small_pieces, part):
    assert len(list(reading.read_pieces(log))) > 5
    table = reading.read_frames(log)
    whole = check(table, DATABASES).observer
    begin_ns, end_ns = part.window(whole.start_ns, whole.end_ns)
    window = replace(whole, start_ns=begin_ns, end_ns=end_ns)
    if part.channel is not None:
        table = table.on_channel(part.channel, log)
    expected = check(table, DATABASES, observer=window)
    assert check_observed(observed(log), DATABASES, part=part) == expected
    assert expected.messages
    assert any(one.verdict.duplicates for one in expected.messages)
    assert any(found.wrong_crc for found in expected.contents)
    assert expected.observer.lost == 1
    assert expected.notes


def test_a_part_that_does_not_exist_is_named(log):
    with pytest.raises(WrongPartError, match="no channel 'can7'; there are can"):
        check_observed(observed(log), DATABASES, part=Part(channel="can7"))
    with pytest.raises(WrongPartError, match="nothing to judge there"):
        check_observed(observed(log), DATABASES, part=Part(from_s=5))


def test_a_window_begins_with_the_earliest_stamp_wherever_it_is(frames, tmp_path):
    file = tmp_path / "late.log"
    order = [*frames[1:], frames[0]._replace(at_ns=0)]
    file.write_text("".join(f"{candump_line(f._replace(at_ns=f.at_ns + 10**9), 'can0')}\n" for f in order))
    done = check_observed(observed(file), DATABASES, part=Part(from_s=0.5))
    assert done.observer.start_ns == 1_500_000_000


def test_the_window_of_a_run_does_not_depend_on_its_stamps(log):
    seen = Observed(
        file=log,
        recording=log,
        start_ns=10**9,
        end_ns=2 * 10**9,
        doubts=Observer(start_ns=0, end_ns=0, lost=3),
    )
    done = check_observed(seen, DATABASES)
    assert (done.observer.start_ns, done.observer.end_ns, done.observer.lost) == (10**9, 2 * 10**9, 4)
    assert done == check(reading.read_frames(log), DATABASES, observer=done.observer)


def test_memory_does_not_grow_with_the_recording(frames, monkeypatch):
    """Ten times the recording, whose gaps scatter, takes as much memory as once."""
    monkeypatch.setattr(median, "WAITING", 256)  # full after some pieces also for a slow message
    table = table_of(frames)
    rng = np.random.default_rng(5)
    judge = RecordingJudge(DATABASES)

    def take(times):
        for _ in range(times):
            jitter = 1000 * rng.integers(-20, 20, len(table))  # a log has microseconds
            judge.take(replace(table, time_ns=table.time_ns + jitter + 3_000_000_000 * next(parts)))

    parts = iter(range(1000))
    take(20)
    tracemalloc.start()
    take(20)
    _, once = tracemalloc.get_traced_memory()
    tracemalloc.reset_peak()
    take(200)
    _, more = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert more < 1.2 * once
