"""The hub keeps the laws of every transport; counters of its clients, and what its end leaves them."""

import errno
import os
import socket
import threading
from pathlib import Path

import pytest

from bus.frame import Frame
from bus.hub.client import HubTransport, hub_status
from bus.hub.packet import SIZE
from bus.hub.peer import Peer
from bus.hub.server import BATCH, Hub
from bus.transport import BusClosed
from tests.bus.hub.running import RunningHub
from tests.bus.laws import WAIT_S, TransportLaws, collect, numbered, readable, unstamped


class TestHub(TransportLaws):
    @pytest.fixture
    def bench(self, hub: RunningHub) -> RunningHub:
        return hub


def test_the_hub_lists_its_clients_with_their_counters(hub: RunningHub) -> None:
    with HubTransport(hub.path, name="plant") as plant, HubTransport(hub.path, name="ecu") as ecu:
        for frame in numbered(3):
            plant.send(frame)
        collect(ecu, 3)
        status = hub_status(hub.path)
        assert [client.name for client in status.clients] == ["plant", "ecu"]
        assert [client.pid for client in status.clients] == [os.getpid()] * 2
        assert [(client.sent, client.delivered) for client in status.clients] == [(3, 0), (0, 3)]
        assert status.frames == 3
        assert status.bit_rate is None
    assert hub_status(hub.path).clients == ()


def test_own_frames_come_back_stamped_when_asked_for(hub: RunningHub) -> None:
    with HubTransport(hub.path, own_messages=True) as sender, hub.connect() as receiver:
        sender.send(Frame(5, b"mine"))
        (seen,) = collect(receiver, 1)
        assert readable(sender, WAIT_S)
        assert sender.drain() == []
        assert sender.confirmations() == [seen]
        assert sender.confirmations() == []


def test_when_the_hub_ends_what_arrived_is_given_first(path: str) -> None:
    running = RunningHub(path)
    with running.connect() as sender, running.connect() as receiver, running.connect() as witness:
        for frame in numbered(3):
            sender.send(frame)
        collect(witness, 3)
        running.stop()
        assert readable(receiver, WAIT_S)
        assert unstamped(receiver.drain()) == numbered(3)
        with pytest.raises(BusClosed, match="the hub is gone"):
            receiver.drain()
        with pytest.raises(BusClosed, match="the hub is gone"):
            sender.send(Frame(1, b""))
    assert not Path(path).exists()


def test_frames_that_the_hub_never_read_do_not_cost_the_reader_its_own(path: str) -> None:
    """Closing with unread packets resets the connection; what had been delivered must survive that."""
    hub = Hub(path)
    receiver = threading.Thread(target=hub.run)
    receiver.start()
    with HubTransport(path) as one, HubTransport(path) as other:
        other.send(Frame(1, b"before"))
        assert readable(one, WAIT_S)
        hub.stop()
        receiver.join()
        one.send(Frame(2, b"unread"))
        hub.close()
        assert unstamped(collect(one, 1)) == [Frame(1, b"before")]
        with pytest.raises(BusClosed):
            one.drain()


def test_a_client_that_leaves_at_once_is_heard_to_the_end_while_others_talk(path: str) -> None:
    """To write to a client that has left is an error; what it had sent before must survive that."""
    count, may_go_on = 3 * BATCH, threading.Event()
    may_go_on.set()
    hub = Hub(path)
    thread = threading.Thread(target=hub.run, args=(may_go_on.wait,), daemon=True)
    thread.start()
    with hub, HubTransport(path, name="hears") as hears, HubTransport(path, name="talks") as talks:
        leaves = HubTransport(path)
        may_go_on.clear()  # the hub reads nothing until all of this has been sent
        for frame in numbered(count):
            assert leaves.send(frame)
        leaves.close()
        talks.send(Frame(1, b"others"))
        may_go_on.set()
        heard = unstamped(collect(hears, count + 1))
        assert [frame for frame in heard if frame.can_id != 1] == numbered(count)
        assert [client.name for client in hub_status(path).clients] == ["hears", "talks"]
        hub.stop()
        thread.join()


def test_a_client_whose_stream_would_have_a_gap_is_disconnected() -> None:
    """Without memory for a frame the client has not left: it has to learn that it lacks one."""

    def without_memory(records: object) -> int:
        raise OSError(errno.ENOBUFS, os.strerror(errno.ENOBUFS))

    ours, theirs = socket.socketpair()
    with ours, theirs:
        peer = Peer(ours)
        peer._send = without_memory
        assert peer.give(memoryview(bytearray(SIZE)), 1)
        assert peer.gone
