"""The shell around the unit: every way a run can end, and what it leaves behind."""

import asyncio
import socket
import time
from typing import Self

import numpy as np
import pytest

from bus.errors import BusFinding
from bus.frame import Frame
from bus.pacing import KeptTiming
from bus.transport import BusClosed, Statistics
from dbc.protection import Finding as Check
from plant import node
from plant.truth import Truth
from plant.unit.reception import Finding

MS = 1_000_000


class FakeBus:
    """A transport in memory; `incoming` is what has arrived. The hub dies on the send number `dies_at`."""

    def __init__(self, dies_at: int | None = None) -> None:
        self.sent: list[Frame] = []
        self.incoming: list[Frame] = []
        self._dies_at = dies_at
        self._near, self._far = socket.socketpair()
        self._near.setblocking(False)

    def arrive(self, *frames: Frame) -> None:
        self.incoming += frames
        self._far.send(b"x")

    def hang_up(self) -> None:
        self._far.close()

    def send(self, frame: Frame) -> bool:
        if len(self.sent) == self._dies_at:
            raise BusClosed("the hub ended")
        self.sent.append(frame)
        return True

    def drain(self, limit: int = 64) -> list[Frame]:
        try:
            if self._near.recv(4096) == b"":
                raise BusClosed("the hub ended")
        except BlockingIOError:
            pass
        frames, self.incoming = self.incoming[:limit], self.incoming[limit:]
        return frames

    def findings(self) -> list[BusFinding]:
        return []

    def fileno(self) -> int:
        return self._near.fileno()

    def statistics(self) -> Statistics:
        return Statistics(sent=len(self.sent))

    def close(self) -> None:
        self._near.close()
        self._far.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class FakeUnit:
    """Sends its tick number in one frame per tick; complains about every frame with id 13."""

    def __init__(self, ticks: int) -> None:
        self._last = ticks
        self.ticks = 0
        self.heard: list[tuple[Frame, int]] = []

    @property
    def sequence(self) -> int:
        return self.ticks - 1

    @property
    def truth(self) -> Truth:
        row = np.zeros(Truth.size)
        row[Truth.time_s.at] = self.ticks * 0.01
        return Truth(row)

    @property
    def finished(self) -> bool:
        return self.ticks >= self._last

    def tick(self, now_ns: int) -> list[Frame]:
        self.ticks += 1
        return [Frame(1, bytes([self.ticks % 256]))]

    def receive(self, frame: Frame, now_ns: int) -> list[Finding]:
        self.heard.append((frame, now_ns))
        return [Finding("Thirteen", Check.REPEATED, now_ns)] if frame.can_id == 13 else []


@pytest.fixture
def bus():
    with FakeBus() as bus:
        yield bus


def times(path) -> list[float]:
    with np.load(path) as file:
        return file["time_s"].tolist()


def test_it_ends_when_the_unit_has_finished_and_leaves_the_truth(bus, tmp_path):
    asyncio.run(node.run(bus, FakeUnit(20), realtime=False, truth_path=tmp_path / "truth.npz"))
    assert [frame.data[0] for frame in bus.sent] == list(range(1, 21))
    assert times(tmp_path / "truth.npz") == [k * 0.01 for k in range(1, 21)]


def test_frames_that_have_come_reach_the_unit_before_its_tick_with_their_stamps(bus):
    bus.arrive(Frame(7, b"a", 42), Frame(13, b"b"))
    unit, findings = FakeUnit(1), []
    before = time.monotonic_ns()
    asyncio.run(node.run(bus, unit, realtime=False, on_finding=findings.append))
    (first, first_ns), (second, second_ns) = unit.heard
    assert (first.data, first_ns) == (b"a", 42)
    assert second.data == b"b"
    assert second_ns >= before  # the transport did not stamp it
    assert [finding.what for finding in findings] == [Check.REPEATED]


def test_more_frames_than_one_drain_gives_are_all_taken(bus):
    bus.arrive(*(Frame(7, bytes([k])) for k in range(200)))
    unit = FakeUnit(1)
    asyncio.run(node.run(bus, unit, realtime=False))
    assert [frame.data[0] for frame, _ in unit.heard] == list(range(200))


def test_a_hub_that_dies_while_sending_is_bus_closed_and_the_truth_is_kept(tmp_path):
    with FakeBus(dies_at=5) as bus, pytest.raises(BusClosed, match="the hub ended"):
        asyncio.run(node.run(bus, FakeUnit(100), realtime=False, truth_path=tmp_path / "truth.npz"))
    assert len(times(tmp_path / "truth.npz")) == 5


def test_a_hub_that_dies_while_the_node_waits_is_bus_closed(bus):
    bus.hang_up()
    with pytest.raises(BusClosed, match="the hub ended"):
        asyncio.run(node.run(bus, FakeUnit(10), period_ns=10_000 * MS))


def test_cancelled_it_ends_at_once_and_keeps_the_truth(bus, tmp_path):
    ticked = asyncio.Event()
    unit = FakeUnit(1_000_000)

    async def interrupted() -> None:
        running = asyncio.create_task(
            node.run(
                bus, unit, period_ns=MS, on_tick=lambda *_: ticked.set(), truth_path=tmp_path / "truth.npz"
            )
        )
        await ticked.wait()
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running

    asyncio.run(interrupted())
    assert len(times(tmp_path / "truth.npz")) == unit.ticks >= 1


def test_a_bug_in_the_unit_is_not_hidden(bus):
    class Broken(FakeUnit):
        def tick(self, now_ns: int) -> list[Frame]:
            raise ZeroDivisionError("a bug")

    with pytest.raises(ExceptionGroup) as error:
        asyncio.run(node.run(bus, Broken(1), realtime=False))
    assert error.group_contains(ZeroDivisionError, match="a bug")


def test_in_real_time_ticks_are_never_early_and_every_one_is_timed(bus):
    """Not a test of speed: however starved the host is, due times and counts have to agree."""
    timing, missed = KeptTiming(), []

    def note(_: FakeUnit) -> None:
        missed.append(timing.missed)

    asyncio.run(node.run(bus, FakeUnit(30), period_ns=2 * MS, timing=timing, on_tick=note))
    columns = timing.columns()
    assert (columns["lateness_ns"] >= 0).all()
    assert (columns["execution_ns"] > 0).all()
    assert len(columns["due_ns"]) == 30
    assert (np.diff(columns["due_ns"]) == 2 * MS * (1 + np.diff(missed))).all()
