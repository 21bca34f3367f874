"""The embedded hub: a CAN bus made of one process and Unix sockets, for machines without CAN.

Each frame goes to every other client. The hub stamps it on arrival, strictly increasing,
so all clients agree on the time and the order of the frames. A client that does not keep
up loses frames, which are counted for it; the other clients are not affected. With a bit rate, the hub
also takes the time that a real bus would take (see bus.arbitration).

The loop is plain epoll with one buffer: all frames that a client has sent since the last round
are one read, and one write to every other client.
"""

import os
import select
import signal
import time
from collections.abc import Callable
from typing import Any

from bus.arbitration import Arbiter
from bus.bounded_json import printable
from bus.closing import Closing
from bus.frame import Frame
from bus.hub import packet
from bus.hub.listener import Listener
from bus.hub.peer import Peer
from bus.hub.status import HubStatus
from bus.ticks import Alarm

BATCH = 64
"""Records taken from one client before the others get their turn."""
BATCH_SIZE = BATCH * packet.SIZE
NO_HELLO = "the first message must be a hello"
CONTROL_LIMIT = 16 * packet.SIZE
"""Longest control message that a client may send [bytes]."""
WAITING_LIMIT = 64
"""Frames of one client that may wait for the modelled wire before the hub stops reading from it."""
CLIENT_LIMIT = 64
"""Clients at a time."""
SILENT_LIMIT = 64
"""Connections at a time that have not said hello; beyond it the oldest of them is closed."""


class Hub(Closing):
    """A hub that listens from construction on and relays while `run` runs."""

    def __init__(self, path: str, *, bit_rate: int | None = None, data_bit_rate: int | None = None) -> None:
        """path: of the socket, or @NAME; rates [bit/s], None: as fast as it goes.

        BusUnavailable if the socket cannot be made.
        """
        self._arbiter: Arbiter[Peer] | None = Arbiter(bit_rate, data_bit_rate) if bit_rate else None
        self._listener = Listener(path)
        self._peers: dict[int, Peer] = {}
        self._clients: tuple[Peer, ...] = ()
        self._paused: set[Peer] = set()
        # one buffer for all: the start of an unfinished control message, then one batch
        self._buffer = bytearray(CONTROL_LIMIT + BATCH_SIZE)
        self._view = memoryview(self._buffer)
        self._stamp_ns = self._started_ns = time.monotonic_ns()
        self._frames = 0
        self._stopping = False
        self._alarm = Alarm()
        # an eventfd may be written from a signal handler or another thread; a Python event could not wake epoll
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._epoll = select.epoll()
        for source in (self._listener.socket.fileno(), self._alarm.fileno(), self._wake):
            self._epoll.register(source, select.EPOLLIN)

    @property
    def path(self) -> str:
        """The address of its socket."""
        return self._listener.path

    def run(self, after_round: Callable[[], None] | None = None) -> None:
        """Relay until `stop`; after_round: called after each round, when all arrived frames are served."""
        listening, alarm, writable = self._listener.socket.fileno(), self._alarm.fileno(), select.EPOLLOUT
        while not self._stopping:
            for number, events in self._epoll.poll(maxevents=CLIENT_LIMIT):
                peer = self._peers.get(number)
                if peer is not None:
                    # first give, then take: a client that is behind gets room before it causes more traffic
                    if events & writable:
                        self._flush(peer)
                    # EPOLLHUP and EPOLLERR also lead to a read, which then reports the end
                    if events != writable:
                        self._read(peer)
                    if peer.gone:
                        self._remove(peer)
                elif number == listening:
                    self._accept()
                elif number == alarm:
                    self._advance()
            if after_round is not None:
                after_round()

    def stop(self) -> None:
        """End `run`; may be called from a signal handler or another thread."""
        self._stopping = True
        os.eventfd_write(self._wake, 1)

    def close(self) -> None:
        """Disconnect everybody and remove the socket; a second call does nothing."""
        if self._epoll.closed:
            return
        self._listener.close()
        for peer in self._peers.values():
            peer.connection.close()
        self._epoll.close()
        self._alarm.close()
        os.close(self._wake)

    def status(self) -> HubStatus:
        """Counters of the hub and of every client."""
        return HubStatus(
            frames=self._frames,
            uptime_s=(time.monotonic_ns() - self._started_ns) * 1e-9,
            bit_rate=self._arbiter.bit_rate if self._arbiter else None,
            busy_s=self._arbiter.busy_ns * 1e-9 if self._arbiter else 0.0,
            clients=tuple(client.status(self._waiting(client)) for client in self._clients),
        )

    def _waiting(self, client: Peer) -> int:
        return self._arbiter.waiting(client) if self._arbiter else 0

    def _accept(self) -> None:
        self._make_room()
        try:
            connection, _ = self._listener.socket.accept()
        except OSError:  # it left before we looked
            return
        peer = Peer(connection)
        self._peers[peer.number] = peer
        self._epoll.register(peer.number, select.EPOLLIN)

    def _make_room(self) -> None:
        """Close the oldest connection that never said hello, if there are too many: descriptors are a limited resource."""
        # dicts keep their order, so the first silent peer is the oldest
        silent = [peer for peer in self._peers.values() if not peer.name]
        if len(silent) >= SILENT_LIMIT:
            self._remove(silent[0])

    def _flush(self, peer: Peer) -> None:
        """Give a client what waited for its socket."""
        peer.flush()
        self._watch(peer)

    def _read(self, peer: Peer) -> None:
        """Take over at most BATCH records of one client, behind the unfinished part that was kept from before."""
        kept, into = 0, self._view
        if peer.unread:
            kept = len(peer.unread)
            into[:kept] = peer.unread
            into, peer.unread = into[kept:], b""
        try:
            # with a bit rate no more is read than may wait: the client's own socket then fills and slows it down
            size = peer.receive(into, BATCH_SIZE if self._arbiter is None else self._room(peer))
        except BlockingIOError:
            return
        except OSError:
            # reset by a client that was killed: the same as an orderly end, a read of 0 bytes
            size = 0
        if size == 0:
            peer.gone = True
            return
        end = kept + size
        at = packet.frames_until(self._buffer, 0, end)
        if at:
            self._take(peer, self._view[:at])
        if at < end and not peer.gone:
            self._serve_others(peer, at, end)

    def _room(self, peer: Peer) -> int:
        """Bytes that may be read from a client while its frames wait; at least one record, so that a hang-up is seen."""
        return packet.SIZE * max(1, min(BATCH, WAITING_LIMIT - self._waiting(peer)))

    def _serve_others(self, peer: Peer, at: int, end: int) -> None:
        """Serve the control messages in [at, end) of the buffer, where no frame begins; an unfinished one is kept."""
        while at + packet.SIZE <= end and not peer.gone:
            message = packet.control_size(self._buffer, at)
            if message > CONTROL_LIMIT:
                self._refuse(peer, f"a control message of {message} bytes; at most {CONTROL_LIMIT} are taken")
            elif at + message > end:
                break
            elif message:
                self._answer(peer, self._view[at : at + message])
            elif peer.name:
                # a frame with a length that no bus carries: counted and skipped, the client stays
                peer.malformed += 1
            else:
                self._refuse(peer, NO_HELLO)
            start = at + (message or packet.SIZE)
            at = packet.frames_until(self._buffer, start, end)
            if at > start and not peer.gone:
                self._take(peer, self._view[start:at])
        peer.unread = bytes(self._view[at:end])

    def _take(self, peer: Peer, records: memoryview) -> None:
        """Frames of a client: relay them at once, or by the modelled wire."""
        if not peer.name:
            self._refuse(peer, NO_HELLO)
        elif self._arbiter is None:
            self._relay(peer, records, time.monotonic_ns())
        else:
            self._offer(peer, self._arbiter, records)

    def _relay(self, sender: Peer, records: memoryview, stamp_ns: int) -> None:
        """Stamp frames and give them to every other client."""
        # two batches within one reading of the clock still get increasing stamps
        if stamp_ns <= self._stamp_ns:
            stamp_ns = self._stamp_ns + 1
        count = packet.stamp(records, stamp_ns)
        self._stamp_ns = stamp_ns + count - 1
        self._frames += count
        sender.sent += count
        for client in self._clients:
            if client is not sender and not client.give(records, count):
                self._watch(client)
        if sender.wants_own and not sender.gone:
            # last, because it changes the records that the others were given
            packet.mark_own(records)
            if not sender.give(records, count):
                self._watch(sender)

    def _offer(self, peer: Peer, arbiter: Arbiter[Peer], records: memoryview) -> None:
        """Put frames on the modelled wire; a client with too many waiting frames is no longer read."""
        now_ns = time.monotonic_ns()
        arrived = []
        for can_id, length, flags, _, data, _, _ in packet.LAYOUT.iter_unpack(records):
            arrived += arbiter.offer(peer, Frame(can_id, data[:length], 0, flags), now_ns)
        self._deliver(arrived)
        self._alarm.set(arbiter.due_ns)
        if arbiter.waiting(peer) >= WAITING_LIMIT:
            self._paused.add(peer)
            self._watch(peer)

    def _advance(self) -> None:
        """Deliver the frames whose last bit the modelled wire has sent by now."""
        if self._arbiter is None:
            return
        self._deliver(self._arbiter.advance(time.monotonic_ns()))
        self._alarm.set(self._arbiter.due_ns)

    def _deliver(self, arrived: list[tuple[Peer, Frame]]) -> None:
        """Relay frames that the wire has carried, also those of a sender that has left since."""
        for sender, frame in arrived:
            self._relay(sender, memoryview(bytearray(packet.pack(frame))), frame.at_ns)
            if sender in self._paused and self._waiting(sender) < WAITING_LIMIT:
                self._paused.discard(sender)
                self._watch(sender)

    def _answer(self, peer: Peer, records: memoryview) -> None:
        """Serve a control message."""
        try:
            message = packet.read_control(records)
        except ValueError as error:
            self._refuse(peer, f"no control message: {error}")
            return
        if "hello" in message:
            self._welcome(peer, message)
        elif "status" in message:
            peer.say(packet.control(self.status().to_message()))
        else:
            self._refuse(peer, f"unknown control message with keys {printable(', '.join(message)) or 'none'}")

    def _welcome(self, peer: Peer, message: dict[str, Any]) -> None:
        if message.get("protocol") != packet.PROTOCOL:
            # compared exactly: a mixed installation would misread records silently
            spoken = printable(str(message.get("protocol")))
            self._refuse(peer, f"protocol {spoken} spoken, {packet.PROTOCOL} wanted: mixed versions?")
            return
        if len(self._clients) >= CLIENT_LIMIT:
            self._refuse(peer, f"it already has {CLIENT_LIMIT} clients, as many as it takes")
            return
        peer.name = printable(str(message["hello"])) or "unnamed"
        peer.wants_own = bool(message.get("own"))
        # a second hello changes the name and the wish for own frames, but adds no client
        if peer not in self._clients:
            self._clients = (*self._clients, peer)
        peer.say(packet.control({"welcome": packet.PROTOCOL}))

    def _refuse(self, peer: Peer, reason: str) -> None:
        peer.say(packet.control({"refused": reason}))
        peer.gone = True

    def _watch(self, peer: Peer) -> None:
        """Register for the events that this client's state needs: no write event while nothing waits, or epoll spins."""
        reading = 0 if peer in self._paused else select.EPOLLIN
        writing = select.EPOLLOUT if peer.behind else 0
        self._epoll.modify(peer.number, reading | writing)

    def _remove(self, peer: Peer) -> None:
        self._epoll.unregister(peer.number)
        self._clients = tuple(client for client in self._clients if client is not peer)
        self._paused.discard(peer)
        del self._peers[peer.number]
        peer.connection.close()


def serve(
    path: str,
    *,
    bit_rate: int | None = None,
    data_bit_rate: int | None = None,
    on_ready: Callable[[], None] | None = None,
    after_round: Callable[[], None] | None = None,
) -> HubStatus:
    """Run a hub until SIGINT or SIGTERM; returns its last counters. Call it from the main thread.

    on_ready: called once it listens; after_round: as of `Hub.run`.
    """
    with Hub(path, bit_rate=bit_rate, data_bit_rate=data_bit_rate) as hub:
        signals = (signal.SIGINT, signal.SIGTERM)
        before = [signal.signal(number, lambda *_: hub.stop()) for number in signals]
        try:
            if on_ready is not None:
                on_ready()
            hub.run(after_round)
            return hub.status()
        finally:
            for number, handler in zip(signals, before, strict=True):
                signal.signal(number, handler)
