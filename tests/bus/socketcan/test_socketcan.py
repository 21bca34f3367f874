"""SocketCAN on virtual interfaces of a kernel that has CAN (scripts/with-vcan provides one)."""

import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bus.address import open_transport
from bus.errors import Fault
from bus.frame import EXTENDED, FD, Frame
from bus.socketcan.link import can_interfaces
from bus.socketcan.transport import RECEIVE_BUFFER, SocketCanTransport
from bus.socketcan.wallclock import SHARED
from bus.transport import BusUnavailable
from tests.bus.laws import WAIT_S, TransportLaws, collect, numbered, readable, unstamped
from tests.bus.vcan import INTERFACE, ROOT, Vcan, ip, kinds, wait_until

pytestmark = [pytest.mark.socketcan, pytest.mark.usefixtures("vcan")]


class TestSocketCan(TransportLaws):
    @pytest.fixture
    def bench(self) -> Vcan:
        return Vcan()


@pytest.fixture
def spare() -> Iterator[str]:
    """An interface that a test may take down and remove."""
    name = "vcan9"
    ip("link", "add", "dev", name, "type", "vcan")
    ip("link", "set", name, "up")
    yield name
    if name in can_interfaces():
        ip("link", "del", name)


def test_the_kernels_filters_let_only_what_they_name_through() -> None:
    wanted = [(0x18FF0000 | EXTENDED, 0x1FFF0000 | EXTENDED), (0x123, 0x7FF | EXTENDED)]
    with SocketCanTransport(INTERFACE) as sender, SocketCanTransport(INTERFACE, filters=wanted) as receiver:
        for can_id in (0x122, 0x123, 0x18FE0001 | EXTENDED, 0x18FF0001 | EXTENDED):
            sender.send(Frame(can_id, b""))
        assert [frame.can_id for frame in collect(receiver, 2)] == [0x123, 0x18FF0001 | EXTENDED]
        assert not readable(receiver)


def test_own_frames_come_back_with_the_stamp_that_others_see() -> None:
    with SocketCanTransport(INTERFACE, own_messages=True) as sender, SocketCanTransport(INTERFACE) as other:
        sender.send(Frame(5, b"mine"))
        seen = collect(other, 1)
        assert readable(sender, WAIT_S)
        assert sender.drain() == []
        assert sender.confirmations() == seen
        assert sender.confirmations() == []
        assert sender.statistics().received == 0


@pytest.mark.parametrize("hours", [-1, 1])
def test_a_clock_set_between_a_stamp_and_its_reading_moves_no_stamp(
    hours: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The difference of the clocks is then that of another moment; stamps lie between arrival and reading all the same."""
    with SocketCanTransport(INTERFACE) as receiver, SocketCanTransport(INTERFACE) as sender:
        assert receiver.drain() == []
        monkeypatch.setattr(SHARED, "ahead_ns", SHARED.ahead_ns + hours * 3_600_000_000_000)
        monkeypatch.setattr(SHARED, "set_ns", time.monotonic_ns())
        monkeypatch.setattr(SHARED, "check", lambda: None)
        before_ns = time.monotonic_ns()
        sender.send(Frame(1, b"a"))
        sender.send(Frame(2, b"b"))
        first, second = collect(receiver, 2)
        after_ns = time.monotonic_ns()
    # the other bound is the last look at an empty queue, less what lies between a stamp and the queue
    assert before_ns - 50_000_000 < first.at_ns <= second.at_ns <= after_ns


def test_a_frame_that_reaches_the_queue_late_keeps_its_stamp() -> None:
    """A starved kernel stamps a frame, and a reader finds the queue empty before the frame gets there."""
    with SocketCanTransport(INTERFACE) as receiver, SocketCanTransport(INTERFACE) as sender:
        sender.send(Frame(1, b"a"))
        sent_ns = time.monotonic_ns()
        time.sleep(0.02)
        receiver._empty_ns = time.monotonic_ns()  # as if a drain had found nothing just now
        (frame,) = collect(receiver, 1)
    assert frame.at_ns <= sent_ns


def test_a_small_receive_buffer_loses_frames_and_the_kernel_counts_them() -> None:
    """At once, not only with the next frame that arrives; and frames from before the loss, drained after, change nothing."""
    with (
        SocketCanTransport(INTERFACE) as sender,
        SocketCanTransport(INTERFACE) as witness,
        SocketCanTransport(INTERFACE, receive_buffer=4096) as small,
    ):
        for frame in numbered(100):
            sender.send(frame)
        collect(witness, 100)
        lost = small.statistics().dropped_in
        got = len(small.drain(100))
        assert lost == 100 - got
        sender.send(Frame(0x7FF, b"mark"))
        assert collect(small, 1)[0].data == b"mark"
        assert 0 < got < 100
        assert small.statistics().dropped_in == 100 - got


@pytest.mark.parametrize("privileged", [True, False])
def test_the_receive_buffer_is_what_was_asked_for_as_far_as_the_kernel_grants(privileged: bool) -> None:
    """Anybody gets as much as rmem_max, root what it wants; the kernel doubles both for its own needs (socket(7))."""
    root = os.geteuid() == 0 and Path("/proc/self/uid_map").read_text().split() == ["0", "0", "4294967295"]

    def work() -> int:
        if root and not privileged:
            os.setresuid(65534, 65534, 65534)
        with SocketCanTransport(INTERFACE) as transport:
            return transport.receive_buffer

    limit = RECEIVE_BUFFER if root and privileged else int(Path("/proc/sys/net/core/rmem_max").read_text())
    assert in_a_process(work) == 2 * min(limit, RECEIVE_BUFFER)


def in_a_process(work: Callable[[], int]) -> int:
    """What `work` returns, from a process that may give up what this one has."""
    ours, theirs = multiprocessing.get_context("fork").Pipe()
    process = multiprocessing.get_context("fork").Process(target=lambda: theirs.send(work()))
    process.start()
    assert ours.poll(WAIT_S)
    result: int = ours.recv()
    process.join()
    return result


def test_an_interface_that_goes_down_and_up_again_is_reported_and_survived(spare: str) -> None:
    with SocketCanTransport(spare) as sender, SocketCanTransport(spare) as receiver:
        descriptor = receiver.fileno()
        ip("link", "set", spare, "down")
        wait_until(receiver, up=False)
        for _ in range(3):
            assert not sender.send(Frame(1, b"lost"))
        assert sender.statistics().dropped_out == 3
        assert receiver.drain() == []
        ip("link", "set", spare, "up")
        wait_until(receiver, up=True)
        sender.drain()
        assert kinds(receiver.findings()) == kinds(sender.findings()) == [Fault.LINK_DOWN, Fault.LINK_UP]
        assert sender.send(Frame(2, b"again"))
        assert unstamped(collect(receiver, 1)) == [Frame(2, b"again")]
        assert receiver.fileno() == descriptor


def test_an_interface_that_is_removed_and_made_anew_is_used_again_with_its_filters(spare: str) -> None:
    with SocketCanTransport(spare, filters=[(0x100, 0x7FF)]) as receiver:
        ip("link", "del", spare)
        wait_until(receiver, up=False)
        assert not receiver.send(Frame(1, b"lost"))
        ip("link", "add", "dev", spare, "type", "vcan")
        ip("link", "set", spare, "up")
        wait_until(receiver, up=True)
        assert kinds(receiver.findings())[0] in (Fault.LINK_DOWN, Fault.LINK_GONE)
        with SocketCanTransport(spare) as sender:
            sender.send(Frame(0x200, b"other"))
            sender.send(Frame(0x100, b"wanted"))
            assert unstamped(collect(receiver, 1)) == [Frame(0x100, b"wanted")]
        assert not readable(receiver)


def test_without_filters_everything_passes_again_after_the_interface_was_made_anew(spare: str) -> None:
    """The kernel forgets a socket's filters with its interface, also the one that passes everything."""
    with SocketCanTransport(spare) as receiver:
        ip("link", "del", spare)
        wait_until(receiver, up=False)
        ip("link", "add", "dev", spare, "type", "vcan")
        ip("link", "set", spare, "up")
        wait_until(receiver, up=True)
        with SocketCanTransport(spare) as sender:
            sender.send(Frame(0x200, b"any"))
            assert unstamped(collect(receiver, 1)) == [Frame(0x200, b"any")]


def test_interfaces_are_those_of_our_network_namespace(spare: str) -> None:
    """/sys of another namespace stays mounted there, and would list its interfaces."""
    script = "from bus.socketcan.link import can_interfaces; print(*can_interfaces())"
    command = [ROOT / "scripts" / "vcan-up", sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    if done.returncode:
        pytest.skip(f"no network namespace to be had: {done.stderr.strip()}")
    assert done.stdout.split() == ["vcan0", "vcan1"]
    assert spare in can_interfaces()


def test_an_interface_that_is_down_is_refused_with_the_command_that_helps(spare: str) -> None:
    ip("link", "set", spare, "down")
    with pytest.raises(
        BusUnavailable, match=f"{spare}: it is down; bring it up: sudo ip link set {spare} up"
    ):
        SocketCanTransport(spare)


@pytest.mark.parametrize("name", ["can7", "lo"])
def test_what_is_no_can_interface_is_refused_with_those_that_are(name: str) -> None:
    with pytest.raises(BusUnavailable, match=rf"{name}: no such CAN interface \(there are: vcan0, vcan1\)"):
        open_transport(f"socketcan:{name}")


def test_an_interface_without_can_fd_says_so(spare: str) -> None:
    ip("link", "set", spare, "down")
    ip("link", "set", spare, "mtu", "16", "up")
    with SocketCanTransport(spare) as sender:
        with pytest.raises(ValueError, match="carries no CAN FD frames"):
            sender.send(Frame(1, bytes(12), 0, FD))
        assert sender.send(Frame(1, bytes(8)))


def test_the_two_interfaces_are_two_buses() -> None:
    with SocketCanTransport("vcan0") as sender, SocketCanTransport("vcan1") as stranger:
        with SocketCanTransport("vcan0") as witness:
            sender.send(Frame(1, b""))
            collect(witness, 1)
        assert not readable(stranger)
