"""python-can and cantools on the hub: the library in this process, their tools as processes."""

import asyncio
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import can
import cantools
import pytest
from hypothesis import given, settings

from bus.frame import ERROR, EXTENDED, FD, Frame
from bus.hub.client import hub_status
from bus.python_can import HubBus, from_message, to_message
from tests.bus.hub.running import RunningHub
from tests.bus.laws import WAIT_S, classic, collect, fd, remote, unstamped
from tests.bus.terminal import Terminal, feed_until_shown

DBC = Path(__file__).resolve().parents[2] / "dbc" / "loader.dbc"


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[RunningHub]:
    running = RunningHub(str(tmp_path / "hub"))
    yield running
    running.stop()


def python_can(hub: RunningHub, **options: object) -> can.BusABC:
    """The bus as a user opens it: by the name of the entry point."""
    return can.Bus(interface="loaderhil", channel=hub.path, **options)


@given(classic | remote | fd)
def test_every_frame_survives_the_conversion_both_ways(frame: Frame) -> None:
    assert from_message(to_message(frame, 0, "x"))._replace(at_ns=0) == frame


def test_every_frame_survives_the_way_through_python_can_and_back(hub: RunningHub) -> None:
    with python_can(hub) as bus, hub.connect() as other:
        assert isinstance(bus, HubBus)

        @given(classic | remote | fd)
        @settings(deadline=None, max_examples=50)
        def law(frame: Frame) -> None:
            other.send(frame)
            message = bus.recv(WAIT_S)
            assert message is not None
            bus.send(message)
            assert unstamped(collect(other, 1)) == [frame]

        law()


def test_two_python_can_buses_understand_each_other(hub: RunningHub) -> None:
    with python_can(hub) as one, python_can(hub) as other:
        sent = can.Message(arbitration_id=0x18FF1234, data=range(64), is_fd=True, bitrate_switch=True)
        one.send(sent)
        received = other.recv(WAIT_S)
        assert received is not None
        assert received.equals(sent, timestamp_delta=None, check_channel=False)
        assert received.is_rx
        assert one.recv(0) is None


def test_timestamps_are_wall_time(hub: RunningHub) -> None:
    with python_can(hub) as bus, hub.connect() as other:
        before = time.time()
        other.send(Frame(1, b""))
        message = bus.recv(WAIT_S)
        assert message is not None
        assert (
            before - 0.01 <= message.timestamp <= time.time() + 0.01
        )  # the two clocks are read one after the other


def test_own_messages_come_back_marked_when_asked_for(hub: RunningHub) -> None:
    with python_can(hub, receive_own_messages=True) as bus, hub.connect() as other:
        bus.send(can.Message(arbitration_id=1, is_extended_id=False))
        collect(other, 1)
        other.send(Frame(2, b""))
        seen = [bus.recv(WAIT_S), bus.recv(WAIT_S)]
        assert [(message.arbitration_id, message.is_rx) for message in seen if message] == [
            (1, False),
            (2, True),
        ]


def test_filters_choose_messages(hub: RunningHub) -> None:
    wanted = [{"can_id": 0x18FF0000, "can_mask": 0x1FFF0000, "extended": True}]
    with python_can(hub, can_filters=wanted) as bus, hub.connect() as other:
        for can_id in (0x100, 0x18FF0001 | EXTENDED, 0x18FE0001 | EXTENDED):
            other.send(Frame(can_id, b""))
        message = bus.recv(WAIT_S)
        assert message is not None
        assert message.arbitration_id == 0x18FF0001
        assert bus.recv(0) is None


def test_error_frames_stay_error_frames(hub: RunningHub) -> None:
    with python_can(hub) as bus, hub.connect() as other:
        other.send(Frame(ERROR | 0x40, bytes(8)))
        message = bus.recv(WAIT_S)
        assert message is not None
        assert message.is_error_frame


def test_no_message_is_none_after_the_timeout(hub: RunningHub) -> None:
    with python_can(hub) as bus:
        assert bus.recv(0) is None
        assert bus.recv(0.01) is None


def test_a_missing_or_lost_hub_is_python_cans_own_kind_of_error(hub: RunningHub, tmp_path: Path) -> None:
    with pytest.raises(can.CanInitializationError, match="there is no hub"):
        can.Bus(interface="loaderhil", channel=str(tmp_path / "nowhere"))
    lost = RunningHub(str(tmp_path / "lost"))
    with python_can(lost) as bus:
        lost.stop()
        with pytest.raises(can.CanOperationError, match="the hub is gone"):
            bus.recv(WAIT_S)
        with pytest.raises(can.CanOperationError, match="the hub is gone"):
            bus.send(can.Message())


def test_the_asynchronous_notifier_of_python_can_gets_every_message(hub: RunningHub) -> None:
    async def listen() -> list[int]:
        with python_can(hub) as bus, hub.connect() as other:
            reader = can.AsyncBufferedReader()
            notifier = can.Notifier(bus, [reader], loop=asyncio.get_running_loop())
            try:
                for number in range(200):
                    other.send(Frame(number, b""))
                async with asyncio.timeout(WAIT_S):
                    return [(await reader.get_message()).arbitration_id for _ in range(200)]
            finally:
                notifier.stop()

    assert asyncio.run(listen()) == list(range(200))


def wait_for_tool(hub: RunningHub, process: subprocess.Popen[bytes]) -> None:
    """Until the tool has joined the hub."""
    deadline = time.monotonic() + WAIT_S
    while all(client.pid != process.pid for client in hub_status(hub.path).clients):
        assert process.poll() is None, "the tool has ended"
        assert time.monotonic() < deadline, "the tool did not join the hub"
        time.sleep(0.02)


@pytest.mark.processes
def test_can_logger_writes_what_is_on_the_hub(hub: RunningHub, tmp_path: Path) -> None:
    log = tmp_path / "out.log"
    command = [sys.executable, "-m", "can.logger", "-i", "loaderhil", "-c", hub.path, "-f", str(log)]
    frames = [
        Frame(0x123, b"\x01\x02"),
        Frame(EXTENDED | 0x18FF1234, bytes(range(8))),
        Frame(0x7FF, bytes(range(12)), 0, FD),
    ]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as logger, hub.connect() as sender:
        wait_for_tool(hub, logger)
        for frame in frames:
            sender.send(frame)
        deadline = time.monotonic() + WAIT_S
        while not (log.exists() and log.stat().st_size):  # it writes by the block: fill one
            assert time.monotonic() < deadline
            sender.send(Frame(1, bytes(8)))
            time.sleep(1e-3)
        logger.send_signal(signal.SIGINT)
        logger.wait(WAIT_S)
    # candump's format: (time) channel frame direction
    lines = [line.split() for line in log.read_text().splitlines()[: len(frames)]]
    assert [words[2] for words in lines] == [
        "123#0102",
        "18FF1234#0001020304050607",
        "7FF##0000102030405060708090A0B",
    ]
    assert {words[1] for words in lines} == {hub.path}
    assert all(abs(float(words[0].strip("()")) - time.time()) < 60 for words in lines)


@pytest.mark.processes
def test_can_viewer_shows_the_hubs_frames(hub: RunningHub) -> None:
    screen = Terminal(sys.executable, "-m", "can.viewer", "-i", "loaderhil", "-c", hub.path)
    try:
        with hub.connect() as sender:
            wait_for_tool(hub, screen.process)
            frame = Frame(EXTENDED | 0x18FF1234, b"\xca\xfe")
            feed_until_shown(sender, frame, screen, "0x18FF1234", "CA FE")
            assert screen.end() == 0
    finally:
        screen.close()


@pytest.mark.processes
def test_cantools_monitor_decodes_the_hubs_frames(hub: RunningHub) -> None:
    message = cantools.database.load_file(DBC).get_message_by_name("Articulation")
    values = {signal.name: 0 for signal in message.signals} | {"ArticulationAngle": 12.5}
    frame = Frame(
        message.frame_id | EXTENDED * message.is_extended_frame, message.encode(values, strict=False)
    )
    command = ("-m", "cantools", "monitor", "-i", "loaderhil", "-c", hub.path, str(DBC))
    screen = Terminal(sys.executable, *command)
    try:
        with hub.connect() as sender:
            wait_for_tool(hub, screen.process)
            feed_until_shown(sender, frame, screen, "Articulation(", "ArticulationAngle: 12.5")
            assert screen.end() == 0
    finally:
        screen.close()
