"""Other people's programs on the same interface: can-utils and python-can, in both directions."""

import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import can
import pytest

from bus.frame import EXTENDED, FD, REMOTE, Frame
from bus.socketcan.transport import SocketCanTransport
from tests.bus.laws import WAIT_S, collect, numbered, readable, unstamped
from tests.bus.terminal import Terminal, feed_until_shown
from tests.bus.vcan import INTERFACE, listeners

pytestmark = [pytest.mark.socketcan, pytest.mark.usefixtures("vcan")]
can_utils = pytest.mark.skipif(shutil.which("candump") is None, reason="can-utils are not installed")
FLOOD = 20_000
BURSTS = 5_000


def open_bus(**options: int) -> SocketCanTransport:
    return SocketCanTransport(INTERFACE, **options)


def wait_for_listeners(count: int, process: subprocess.Popen[str]) -> None:
    """Until so many sockets read everything from the interface."""
    deadline = time.monotonic() + WAIT_S
    while listeners() < count:
        assert process.poll() is None, "the program has ended"
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_python_can_reads_what_we_send_and_we_read_what_it_sends() -> None:
    with can.Bus(interface="socketcan", channel=INTERFACE, fd=True) as bus, open_bus() as ours:
        for frame in (Frame(0x123, b"\1\2"), Frame(EXTENDED | 0x18FF1234, bytes(64), 0, FD)):
            ours.send(frame)
            message = bus.recv(WAIT_S)
            assert message is not None
            assert (message.arbitration_id, bytes(message.data)) == (frame.identifier, frame.data)
            bus.send(message)
            assert unstamped(collect(ours, 1)) == [frame]


def test_our_stamps_are_those_that_python_can_shows() -> None:
    """One frame has one stamp of the kernel, whoever reads it; wall time there, monotonic here."""
    with can.Bus(interface="socketcan", channel=INTERFACE) as bus, open_bus() as sender, open_bus() as ours:
        sender.send(Frame(1, b""))
        message = bus.recv(WAIT_S)
        assert message is not None
        (frame,) = collect(ours, 1)
        ahead_s = max(
            time.time() - time.monotonic() for _ in range(100)
        )  # the pair with the shortest pause between
        assert message.timestamp == pytest.approx(frame.at_ns * 1e-9 + ahead_s, abs=1e-3)


def test_the_logger_of_python_can_writes_what_we_send(tmp_path: Path) -> None:
    log = tmp_path / "out.log"
    command = [sys.executable, "-m", "can.logger", "-i", "socketcan", "-c", INTERFACE, "-f", str(log)]
    frames = [*numbered(20), Frame(EXTENDED | 0x18FF1234, bytes(range(8)))]
    with (
        open_bus() as sender,
        subprocess.Popen(command, stdout=subprocess.DEVNULL, text=True) as logger,
    ):
        wait_for_listeners(2, logger)
        for frame in frames:
            sender.send(frame)
        while not (log.exists() and log.stat().st_size):  # it writes by the block: fill one
            assert logger.poll() is None
            sender.send(Frame(1, bytes(8)))
            time.sleep(1e-3)
        logger.send_signal(signal.SIGINT)
        logger.wait(WAIT_S)
    lines = [line.split() for line in log.read_text().splitlines()[: len(frames)]]
    expected = [f"100#{frame.data.hex().upper()}" for frame in frames[:-1]]
    assert [words[2] for words in lines] == [*expected, "18FF1234#0001020304050607"]
    assert {words[1] for words in lines} == {INTERFACE}


@can_utils
def test_candump_reads_what_we_send() -> None:
    frames = [*numbered(50), Frame(EXTENDED | 0x18FF1234, bytes(range(12)), 0, FD)]
    command = ["candump", "-L", "-n", str(len(frames)), INTERFACE]
    with open_bus() as sender, subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as candump:
        assert candump.stdout is not None
        wait_for_listeners(2, candump)
        for frame in frames:
            sender.send(frame)
        lines = candump.stdout.read().split("\n")[:-1]
    expected = [f"100#{frame.data.hex().upper()}" for frame in frames[:-1]]
    assert [line.split()[2] for line in lines] == [*expected, "18FF1234##4000102030405060708090A0B"]


@can_utils
def test_we_read_what_canplayer_plays(tmp_path: Path) -> None:
    log = tmp_path / "played.log"
    log.write_text(
        "(1.000000) can0 123#1122\n"
        "(1.000100) can0 18FF1234#0102030405060708\n"
        "(1.000200) can0 7FF#R\n"
        "(1.000300) can0 321##5000102030405060708090A0B\n"
    )
    with open_bus() as ours:
        subprocess.run(["canplayer", "-I", log, f"{INTERFACE}=can0"], check=True, timeout=WAIT_S)
        assert unstamped(collect(ours, 4)) == [
            Frame(0x123, b"\x11\x22"),
            Frame(EXTENDED | 0x18FF1234, bytes(range(1, 9))),
            Frame(REMOTE | 0x7FF, b""),
            Frame(0x321, bytes(range(12)), 0, FD | 1),
        ]


@can_utils
def test_cansniffer_shows_what_we_send() -> None:
    screen = Terminal("cansniffer", INTERFACE)
    try:
        with open_bus() as sender:
            feed_until_shown(sender, Frame(0x123, b"\xca\xfe\x42"), screen, "123", "CA FE 42")
            assert screen.end("q\n") == 0
    finally:
        screen.close()


@can_utils
def test_a_flood_of_cangen_is_read_without_a_loss() -> None:
    """Ten frames at a time, up to a thousand times a second: more than two full buses of 500 kbit/s."""
    pace = ("-g", "1", "-c", "10", "-n", str(BURSTS))
    command = ["cangen", INTERFACE, *pace, "-I", "5", "-L", "8", "-D", "i"]
    with open_bus() as ours, subprocess.Popen(command) as cangen:
        frames = collect(ours, BURSTS)
        assert cangen.wait(WAIT_S) == 0
        assert not readable(ours)
        assert ours.statistics().dropped_in == 0
    numbers = [int.from_bytes(frame.data, "little") for frame in frames]
    assert numbers == list(range(numbers[0], numbers[0] + BURSTS))
    stamps = [frame.at_ns for frame in frames]
    assert stamps == sorted(stamps)


@can_utils
def test_of_a_flood_that_nobody_reads_every_loss_is_counted() -> None:
    command = ["cangen", INTERFACE, "-g", "0", "-i", "-n", str(FLOOD), "-m"]
    with open_bus(receive_buffer=65536) as ours, open_bus() as sender:
        subprocess.run(command, check=True, timeout=WAIT_S)
        while ours.drain():
            pass
        sender.send(Frame(0x7FF, b"mark"))
        collect(ours, 1)
        seen = ours.statistics()
        assert seen.received < FLOOD / 10
        assert seen.received + seen.dropped_in == FLOOD + 1
