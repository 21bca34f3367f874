"""SocketCAN on virtual interfaces of a kernel that has CAN (scripts/with-vcan provides one)."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from bus.address import open_transport
from bus.errors import BusFinding, Fault
from bus.frame import ERROR, EXTENDED, FD, Frame
from bus.link import can_interfaces
from bus.socketcan import SocketCanTransport, kernel_has_can
from bus.transport import BusUnavailable
from tests.bus.laws import WAIT_S, TransportLaws, collect, numbered, readable, unstamped

pytestmark = pytest.mark.socketcan
INTERFACE = "vcan0"


@pytest.fixture(autouse=True)
def can_here() -> None:
    if not kernel_has_can():
        pytest.skip("this kernel has no CAN; run scripts/with-vcan .venv/bin/pytest -m socketcan")
    if INTERFACE not in can_interfaces():
        pytest.skip(f"there is no {INTERFACE}; run scripts/with-vcan .venv/bin/pytest -m socketcan")


class Vcan:
    # The difference of the two clocks is measured to well below this, even under user-mode Linux.
    slack_ns = 200_000

    def connect(self) -> SocketCanTransport:
        return SocketCanTransport(INTERFACE)


class TestSocketCan(TransportLaws):
    @pytest.fixture
    def bench(self) -> Vcan:
        return Vcan()


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True)


@pytest.fixture
def spare() -> Iterator[str]:
    """An interface that a test may take down and remove."""
    name = "vcan9"
    ip("link", "add", "dev", name, "type", "vcan")
    ip("link", "set", name, "up")
    yield name
    if name in can_interfaces():
        ip("link", "del", name)


def kinds(findings: list[BusFinding]) -> list[Fault]:
    return [finding.fault for finding in findings]


def wait_until(receiver: SocketCanTransport, *, up: bool) -> None:
    """Drain as an event loop would, until the interface is seen in that state."""
    while receiver.link_up is not up:
        assert readable(receiver, WAIT_S), f"no notice that {receiver.interface} changed"
        receiver.drain()


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


def test_error_frames_come_as_frames_and_as_findings() -> None:
    with SocketCanTransport(INTERFACE) as sender, SocketCanTransport(INTERFACE) as receiver:
        sender.send(Frame(ERROR | 0x044, b"\0\x20\0\0\0\0\x80\0"))
        (frame,) = collect(receiver, 1)
        assert frame.can_id == ERROR | 0x044
        assert kinds(receiver.findings()) == [Fault.BUS_OFF, Fault.PASSIVE]
        assert receiver.findings() == []
        assert receiver.statistics().errors == 1


def test_a_small_receive_buffer_loses_frames_and_the_kernel_counts_them() -> None:
    with (
        SocketCanTransport(INTERFACE) as sender,
        SocketCanTransport(INTERFACE) as witness,
        SocketCanTransport(INTERFACE, receive_buffer=4096) as small,
    ):
        for frame in numbered(100):
            sender.send(frame)
        collect(witness, 100)
        got = len(small.drain(100))
        sender.send(Frame(0x7FF, b"mark"))
        assert collect(small, 1)[0].data == b"mark"
        assert 0 < got < 100
        assert small.statistics().dropped_in == 100 - got


def test_an_interface_that_goes_down_and_up_again_is_told_and_survived(spare: str) -> None:
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


def test_an_interface_that_is_down_is_refused_with_the_command_that_helps(spare: str) -> None:
    ip("link", "set", spare, "down")
    with pytest.raises(BusUnavailable, match=f"{spare} is down; bring it up: ip link set {spare} up"):
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


def test_python_can_reads_what_we_send_and_we_read_what_it_sends() -> None:
    with can.Bus(interface="socketcan", channel=INTERFACE, fd=True) as bus, Vcan().connect() as ours:
        for frame in (Frame(0x123, b"\1\2"), Frame(EXTENDED | 0x18FF1234, bytes(64), 0, FD)):
            ours.send(frame)
            message = bus.recv(WAIT_S)
            assert message is not None
            assert (message.arbitration_id, bytes(message.data)) == (frame.identifier, frame.data)
            bus.send(message)
            assert unstamped(collect(ours, 1)) == [frame]


@pytest.mark.skipif(shutil.which("candump") is None, reason="can-utils are not installed")
def test_candump_reads_what_we_send() -> None:
    frames = [*numbered(50), Frame(EXTENDED | 0x18FF1234, bytes(range(12)), 0, FD)]
    command = ["candump", "-L", "-n", str(len(frames)), INTERFACE]
    with Vcan().connect() as sender, subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as candump:
        assert candump.stdout is not None
        while listeners() < 2:
            assert candump.poll() is None
        for frame in frames:
            sender.send(frame)
        lines = candump.stdout.read().split("\n")[:-1]
    expected = [f"100#{frame.data.hex().upper()}" for frame in frames[:-1]]
    assert [line.split()[2] for line in lines] == [*expected, "18FF1234##4000102030405060708090A0B"]


def listeners() -> int:
    """Sockets of this machine that receive everything from the interface, as the kernel lists them."""
    return Path("/proc/net/can/rcvlist_all").read_text().count(f" {INTERFACE} ")
