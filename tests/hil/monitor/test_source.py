"""Buses and recordings as sources: every frame once, in order, and an end that is noticed."""

import gzip
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from bus.frame import ERROR, LOCAL, Frame
from bus.python_can import to_message
from bus.transport import BusClosed, BusUnavailable
from bus.virtual import VirtualBus, named_bus
from dbc.errors import LogError
from dbc.recordings.writer import candump_line
from hil.monitor.recordings import FollowError, Recordings
from hil.monitor.run import Plan, open_source
from hil.monitor.source import Batch, Buses, Source
from hil.monitor.target import Target, TargetError
from hil.shell.process import Stop
from tests.bus.hub.running import RunningHub
from tests.bus.laws import WAIT_S, numbered, unstamped
from tests.hil.monitor.candump_tool import every_kind


@pytest.fixture
def stop() -> Iterator[Stop]:
    with Stop() as waiting:
        yield waiting


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[RunningHub]:
    running = RunningHub(str(tmp_path / "bench.hub"))
    yield running
    running.stop()


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Standard input is a pipe; the descriptor to write into it."""
    reader, writer = os.pipe()
    with os.fdopen(reader) as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield writer


def end() -> None:
    """What Ctrl-C does."""
    signal.raise_signal(signal.SIGINT)


def until(source: Source, stop: Stop, ready: Callable[[list], bool]) -> list:
    """What came until `ready` is content with it; the signal then ends the source."""
    seen: list = []
    deadline = time.monotonic() + WAIT_S
    for batch in source.batches(stop, 0.02):
        seen += batch.frames
        assert time.monotonic() < deadline, f"only {len(seen)} frames came"
        if ready(seen):
            end()
    return seen


def write_log(path: Path, frames: list[Frame], *, mode: str = "w") -> None:
    with path.open(mode) as file:
        for index, frame in enumerate(frames):
            file.write(candump_line(frame._replace(at_ns=index * 1_000_000), "can0") + "\n")


def test_a_hub_gives_every_frame_with_its_name_and_wall_time(hub: RunningHub, stop: Stop) -> None:
    frames = every_kind(200, seed=5)
    with Buses([Target.parse(f"hub:{hub.path},0:0,#FFFFFFFF")]) as source, hub.connect() as sender:
        for frame in frames:
            sender.send(frame)
        seen = until(source, stop, lambda seen: len(seen) == len(frames))
    assert {name for name, _ in seen} == {"bench"}
    assert unstamped([frame for _, frame in seen]) == frames


def test_origins_mark_the_frames_of_a_hub_as_sent_from_here(hub: RunningHub, stop: Stop) -> None:
    with Buses([Target.parse(f"hub:{hub.path}")], origins=True) as source, hub.connect() as sender:
        sender.send(Frame(1, b""))
        ((_, frame),) = until(source, stop, lambda seen: len(seen) == 1)
    assert frame.flags == LOCAL


def test_filters_hold_on_a_hub(hub: RunningHub, stop: Stop) -> None:
    with Buses([Target.parse(f"hub:{hub.path},100:7FF")]) as source, hub.connect() as sender:
        for can_id in (0x101, 0x100, ERROR | 0x100, 0x7FF, 0x100):
            sender.send(Frame(can_id, b""))
        seen = until(source, stop, lambda seen: len(seen) == 2)
    assert [frame.can_id for _, frame in seen] == [0x100, 0x100]


def test_several_buses_come_in_the_order_of_their_stamps(stop: Stop) -> None:
    clock = iter(range(1, 1000))
    buses = {name: named_bus(name) for name in ("one", "two")}
    for bus in buses.values():
        bus._clock = lambda: next(clock)
    with Buses([Target.parse(f"virtual:{name}") for name in buses]) as source:
        senders = [bus.connect() for bus in buses.values()]
        for index in range(20):
            senders[index % 2].send(Frame(index, b""))
        seen = until(source, stop, lambda seen: len(seen) == 20)
        for sender in senders:
            sender.close()
    assert [frame.can_id for _, frame in seen] == list(range(20))
    assert [name for name, _ in seen] == ["one", "two"] * 10


def test_the_end_of_a_hub_is_reported_after_its_last_frame(tmp_path: Path, stop: Stop) -> None:
    hub = RunningHub(str(tmp_path / "ending.hub"))
    seen: list = []
    with Buses([Target.parse(f"hub:{hub.path}")]) as source:
        with hub.connect() as sender, hub.connect() as witness:
            for frame in numbered(10):
                sender.send(frame)
            while witness.statistics().received < 10:
                witness.drain()
            hub.stop()
        with pytest.raises(BusClosed, match="the hub is gone"):
            seen.extend(batch.frames for batch in source.batches(stop, 0.02))
    assert unstamped([frame for frames in seen for _, frame in frames]) == numbered(10)


def test_a_reader_of_our_output_that_leaves_ends_it_on_a_silent_bus(hub: RunningHub, stop: Stop) -> None:
    reader, writer = os.pipe()
    with Buses([Target.parse(f"hub:{hub.path}")], watch=(writer,)) as source:
        batches = source.batches(stop, 60)
        os.close(reader)
        assert list(batches) == []
    os.close(writer)


def test_time_passes_in_empty_batches(hub: RunningHub, stop: Stop) -> None:
    with Buses([Target.parse(f"hub:{hub.path}")]) as source:
        batches = source.batches(stop, 0.001)
        assert [next(batches).frames for _ in range(3)] == [[], [], []]


def test_a_bus_that_is_not_there_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(BusUnavailable, match="there is no hub"):
        Buses([Target.parse(f"hub:{tmp_path}/none")])


def test_lost_frames_are_counted_by_name(stop: Stop, monkeypatch: pytest.MonkeyPatch) -> None:
    bus = VirtualBus()
    connection = bus.connect(queue_limit=4)
    monkeypatch.setattr("hil.monitor.source.open_transport", lambda *_, **__: connection)
    with Buses([Target.parse("virtual:small")]) as source:
        sender = bus.connect()
        for frame in numbered(10):
            sender.send(frame)
        assert len(until(source, stop, lambda seen: len(seen) == 4)) == 4
        assert source.lost() == {"small": 6}


def everything(source: Source, stop: Stop) -> list:
    return [seen for batch in source.batches(stop, 1.0) for seen in batch.frames]


def test_a_recording_gives_every_frame_and_ends(tmp_path: Path, stop: Stop) -> None:
    frames = every_kind(5000, seed=6)
    log = tmp_path / "drive.log"
    write_log(log, frames)
    source = Recordings([Target.parse(f"{log},0:0,#FFFFFFFF")])
    seen = everything(source, stop)
    assert unstamped([frame for _, frame in seen]) == frames
    assert [frame.at_ns for _, frame in seen] == [index * 1_000_000 for index in range(5000)]
    assert source.now_ns() == 4999 * 1_000_000


def test_compressed_recordings_and_several_of_them(tmp_path: Path, stop: Stop) -> None:
    plain, packed = tmp_path / "a.log", tmp_path / "b.log.gz"
    write_log(plain, numbered(3))
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    seen = everything(Recordings([Target.parse(str(plain)), Target.parse(str(packed))]), stop)
    assert unstamped([frame for _, frame in seen]) == numbered(3) * 2


def test_damaged_lines_are_reported_with_their_number_in_the_file(
    tmp_path: Path, stop: Stop, monkeypatch
) -> None:
    monkeypatch.setattr("hil.monitor.recordings.CHUNK", 64)
    log = tmp_path / "drive.log"
    write_log(log, numbered(20))
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join([*lines[:12], "rubbish\n", *lines[12:]]))
    source = Recordings([Target.parse(str(log))])
    assert len(everything(source, stop)) == 20
    assert source.warnings() == [f"{log}: line 13: no time stamp '(seconds.fraction)' at its start; skipped"]
    assert source.warnings() == []


def test_a_log_without_its_last_line_end_is_read_to_its_end(tmp_path: Path, stop: Stop) -> None:
    log = tmp_path / "drive.log"
    write_log(log, numbered(2))
    log.write_text(log.read_text().rstrip("\n"))
    assert len(everything(Recordings([Target.parse(str(log))]), stop)) == 2


def test_a_growing_log_is_followed_line_by_whole_line(tmp_path: Path, stop: Stop) -> None:
    """The writer waits for each piece to be seen: half lines are held back, a cut-off file starts anew."""
    log = tmp_path / "growing.log"
    write_log(log, numbered(2))
    text = log.read_text()
    middle = len(text) // 2 + 5
    log.write_text(text[:middle])
    source = Recordings([Target.parse(str(log))], follow=True)
    seen, counts = [], []
    for batch in source.batches(stop, 1.0):
        seen += batch.frames
        if not batch.frames:
            counts.append(len(seen))
            if len(counts) == 1:
                with log.open("a") as file:
                    file.write(text[middle:])
            elif len(counts) == 2:
                log.write_text(text[: text.index("\n") + 1])
            else:
                end()
    assert counts == [1, 2, 3]
    assert unstamped([frame for _, frame in seen]) == [*numbered(2), *numbered(1)]
    assert source.warnings() == [f"{log}: the file was cut off; reading it from its start"]


def test_standard_input_is_read_as_it_comes(stop: Stop, typed: int) -> None:
    lines = [candump_line(frame, "can0").encode() + b"\n" for frame in numbered(3)]
    seen = []
    source = Recordings([Target.parse("-")])
    os.write(typed, lines[0] + lines[1][:5])
    for batch in source.batches(stop, 0.01):
        seen += batch.frames
        if len(seen) == 1 and not batch.frames:
            os.write(typed, lines[1][5:] + lines[2])
            os.close(typed)
    assert unstamped([frame for _, frame in seen]) == numbered(3)


def test_the_signal_ends_a_silent_pipe(stop: Stop, typed: int) -> None:
    end()
    assert list(Recordings([Target.parse("-")]).batches(stop, 60)) in ([], [Batch([], 0)])
    os.close(typed)


def test_what_cannot_be_followed_or_mixed_is_refused(tmp_path: Path) -> None:
    from contextlib import ExitStack

    log = tmp_path / "a.log"
    write_log(log, numbered(1))
    file, bus = Target.parse(str(log)), Target.parse("virtual:x")
    with ExitStack() as stack:
        with pytest.raises(FollowError, match="one file at a time, not 2"):
            Recordings([file, file], follow=True)
        with pytest.raises(TargetError, match="different clocks"):
            open_source(Plan(targets=(file, bus)), (), stack)
        with pytest.raises(TargetError, match="a bus is followed anyway"):
            open_source(Plan(targets=(bus,), follow=True), (), stack)


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
def test_other_recordings_are_read_and_not_followed(tmp_path: Path, stop: Stop, suffix: str) -> None:
    recording = tmp_path / f"drive{suffix}"
    with can.Logger(recording) as writer:
        for index, frame in enumerate(numbered(3)):
            writer(to_message(frame._replace(at_ns=index * 1_000_000), 0, "0"))
    target = Target.parse(str(recording))
    assert unstamped([frame for _, frame in everything(Recordings([target]), stop)]) == numbered(3)
    with pytest.raises(FollowError, match="only candump logs can be followed"):
        everything(Recordings([target], follow=True), stop)


def test_a_file_that_is_no_log_is_said_so(tmp_path: Path, stop: Stop) -> None:
    other = tmp_path / "picture.gz"
    other.write_bytes(gzip.compress(b"no log at all\n" * 3))
    with pytest.raises(LogError, match="not a candump log"):
        everything(Recordings([Target.parse(str(other))]), stop)
