"""The bus inside one process."""

import pytest

from bus.frame import Frame
from bus.transport import BusClosed
from bus.virtual import VirtualBus, VirtualTransport, named_bus
from tests.bus.laws import TransportLaws, readable


class Virtual:
    slack_ns = 0

    def __init__(self) -> None:
        self.bus = VirtualBus()

    def connect(self) -> VirtualTransport:
        return self.bus.connect()


class TestVirtualBus(TransportLaws):
    @pytest.fixture
    def bench(self) -> Virtual:
        return Virtual()


def test_stamps_are_those_of_the_given_clock_and_strictly_increase() -> None:
    times = iter([5, 5, 4, 10])
    bus = VirtualBus(lambda: next(times))
    sender, receiver = bus.connect(), bus.connect()
    with sender, receiver:
        for _ in range(4):
            sender.send(Frame(1, b""))
        assert [frame.at_ns for frame in receiver.drain()] == [5, 6, 7, 10]


def test_when_the_bus_ends_what_arrived_is_given_first() -> None:
    bus = VirtualBus()
    with bus.connect() as sender, bus.connect() as receiver:
        sender.send(Frame(1, b"last"))
        bus.close()
        with pytest.raises(BusClosed):
            sender.send(Frame(1, b""))
        assert len(receiver.drain()) == 1
        assert readable(receiver)
        with pytest.raises(BusClosed):
            receiver.drain()


def test_equal_names_mean_the_same_bus_while_it_is_used() -> None:
    bus = named_bus("a")
    assert named_bus("a") is bus
    assert named_bus("b") is not bus
