"""A driver of the kernel with a controller behind it: what states and errors of a real adapter come to.

The kernel's slcan driver speaks the text protocol of serial adapters (LAWICEL) on a terminal; a
pseudo-terminal is the adapter. So error frames, bus-off, carrier and transmit queue are the kernel's own.
"""

import time
from collections.abc import Iterator

import pytest

from bus.errors import Fault
from bus.frame import EXTENDED, Frame
from bus.socketcan.can_socket import kernel_has_can
from bus.socketcan.transport import SocketCanTransport
from tests.bus.laws import WAIT_S, collect, readable, unstamped
from tests.bus.slcan import Adapter
from tests.bus.vcan import ip, kinds, wait_until

pytestmark = pytest.mark.socketcan
QUEUE = 10
"""What the kernel queues for a CAN interface by default."""


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    if not kernel_has_can():
        pytest.skip("this kernel has no CAN; run scripts/with-vcan .venv/bin/pytest -m socketcan")
    try:
        made = Adapter()
    except OSError as error:
        pytest.skip(f"no slcan driver to be had ({error.strerror}): sudo modprobe slcan, or scripts/uml-run")
    yield made
    made.unplug()


def reported(receiver: SocketCanTransport) -> list[str]:
    """What the next error frame says."""
    collect(receiver, 1)
    return [str(finding) for finding in receiver.findings()]


def test_frames_pass_both_ways(adapter: Adapter) -> None:
    with SocketCanTransport(adapter.interface, own_messages=True) as bus:
        adapter.says(b"t12321122\r")
        assert unstamped(collect(bus, 1)) == [Frame(0x123, b"\x11\x22")]
        before_ns = time.monotonic_ns()
        sent = Frame(0x18FF1234 | EXTENDED, b"\1\2")
        assert bus.send(sent)
        adapter.read_until(b"T18FF123420102\r")
        assert bus.drain() == []
        (confirmed,) = bus.confirmations()
        assert confirmed._replace(at_ns=0) == sent
        assert before_ns - 200_000 < confirmed.at_ns < time.monotonic_ns() + 200_000


def test_states_of_the_controller_are_reported_in_words(adapter: Adapter) -> None:
    with SocketCanTransport(adapter.interface) as bus:
        adapter.says(b"sw100099\r")
        assert reported(bus) == [
            "error warning level reached (receive errors)",
            "error counters (transmit 99, receive 100)",
        ]
        adapter.says(b"sp000128\r")
        assert reported(bus)[0] == "controller is error passive (transmit errors)"
        adapter.says(b"sa000000\r")
        assert reported(bus)[0] == "controller is error active again"


def test_errors_on_the_wire_are_reported_in_words(adapter: Adapter) -> None:
    with SocketCanTransport(adapter.interface) as bus:
        adapter.says(b"e1a\r")
        assert reported(bus)[:2] == ["no acknowledgement", "bus error"]
        adapter.says(b"e1O\r")
        assert any("buffer overflowed" in line for line in reported(bus))


def test_bus_off_is_reported_and_what_is_sent_meanwhile_is_counted_as_dropped(adapter: Adapter) -> None:
    """The kernel itself takes such frames without a word, and shows them to others as if they were sent."""
    with SocketCanTransport(adapter.interface) as bus, SocketCanTransport(adapter.interface) as other:
        adapter.says(b"sb255255\r")
        assert reported(bus) == reported(other) == ["bus off"]
        assert bus.drain() == []
        assert not bus.link_up
        for _ in range(3):
            assert not bus.send(Frame(1, b"lost"))
        assert (bus.statistics().sent, bus.statistics().dropped_out) == (0, 3)
        assert other.drain() == []
        ip("link", "set", adapter.interface, "down")
        ip("link", "set", adapter.interface, "up")
        wait_until(bus, up=True)
        assert kinds(bus.findings())[-1] is Fault.LINK_UP
        assert bus.send(Frame(1, b"\7"))
        adapter.read_until(b"t001107\r")


def test_a_controller_that_is_bus_off_already_is_reported_at_once(adapter: Adapter) -> None:
    with SocketCanTransport(adapter.interface) as witness:
        adapter.says(b"sb255255\r")
        collect(witness, 1)
        with SocketCanTransport(adapter.interface) as bus:
            assert kinds(bus.findings()) == [Fault.BUS_OFF]
            assert not bus.send(Frame(1, b"lost"))


def test_a_burst_that_the_queue_does_not_hold_is_reported_once_with_its_remedy(adapter: Adapter) -> None:
    with SocketCanTransport(adapter.interface) as bus:
        for _ in range(2):
            adapter.stall()
            taken = 0
            while bus.send(Frame(1, bytes(8))):
                taken += 1
            assert taken >= QUEUE
            assert not bus.send(Frame(1, bytes(8)))
            (finding,) = bus.findings()
            assert finding.fault is Fault.SEND_QUEUE
            assert f"{adapter.interface} takes {QUEUE} at once" in finding.detail
            assert f"sudo ip link set {adapter.interface} txqueuelen 1000" in finding.detail
            adapter.go_on()
            deadline = time.monotonic() + WAIT_S
            while not bus.send(Frame(2, b"\7")):
                assert time.monotonic() < deadline
                time.sleep(0.01)
            adapter.read_until(b"t002107\r")
        assert bus.findings() == []


def test_an_adapter_that_is_unplugged_is_reported(adapter: Adapter) -> None:
    with SocketCanTransport(adapter.interface) as bus:
        adapter.unplug()
        assert readable(bus, WAIT_S)
        wait_until(bus, up=False)
        assert kinds(bus.findings())[0] in (Fault.LINK_DOWN, Fault.LINK_GONE)
        assert not bus.send(Frame(1, b"lost"))
