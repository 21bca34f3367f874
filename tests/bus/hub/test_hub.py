"""The embedded hub, in this process on a thread, and as a process of its own."""

import contextlib
import itertools
import os
import signal
import socket
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.bits import duration_ns
from bus.frame import Frame
from bus.hub import packet
from bus.hub.client import HubTransport, hub_status
from bus.hub.peer import BACKLOG_LIMIT
from bus.hub.server import CLIENT_LIMIT, CONTROL_LIMIT, SILENT_LIMIT, WAITING_LIMIT, Hub
from bus.transport import BusClosed, BusUnavailable
from tests.bus.laws import WAIT_S, TransportLaws, classic, collect, fd, numbered, readable, remote, unstamped


class RunningHub:
    """A hub on a thread."""

    slack_ns = 0

    def __init__(self, path: str, **options: int) -> None:
        self.path = path
        self.hub = Hub(path, **options)
        self._thread = threading.Thread(target=self.hub.run, name="hub", daemon=True)
        self._thread.start()

    def connect(self) -> HubTransport:
        return HubTransport(self.path)

    def stop(self) -> None:
        self.hub.stop()
        self._thread.join(WAIT_S)
        assert not self._thread.is_alive()
        self.hub.close()


@pytest.fixture
def path(tmp_path: Path) -> str:
    return str(tmp_path / "hub")


@pytest.fixture
def hub(path: str) -> Iterator[RunningHub]:
    running = RunningHub(path)
    yield running
    running.stop()


class TestHub(TransportLaws):
    @pytest.fixture
    def bench(self, hub: RunningHub) -> RunningHub:
        return hub


def raw(path: str) -> socket.socket:
    """A client that speaks the protocol by hand."""
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.settimeout(WAIT_S)
    client.connect(path)
    return client


def hear(client: socket.socket) -> dict[str, object]:
    """The control message that comes next."""
    head = client.recv(packet.SIZE, socket.MSG_PEEK)
    return packet.read_control(client.recv(packet.control_size(head)))


def greet(client: socket.socket, name: str) -> None:
    """Become a client of the hub."""
    client.send(packet.control({"hello": name, "protocol": packet.PROTOCOL}))
    assert hear(client) == {"welcome": packet.PROTOCOL}


def saying(text: bytes) -> bytes:
    """A control message with any text."""
    head = bytearray(packet.control({})[: packet.SIZE])
    head[:4] = len(text).to_bytes(4, sys.byteorder)
    return bytes(head) + text.ljust(-(-len(text) // packet.SIZE) * packet.SIZE, b"\0")


def test_a_name_without_a_file_works_too() -> None:
    running = RunningHub(f"@loaderhil-test-{os.getpid()}")
    try:
        with running.connect() as sender, running.connect() as receiver:
            sender.send(Frame(1, b"x"))
            assert len(collect(receiver, 1)) == 1
    finally:
        running.stop()


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


def test_a_socket_left_by_a_killed_hub_is_replaced(path: str) -> None:
    left = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    left.bind(path)
    left.close()
    running = RunningHub(path)
    running.connect().close()
    running.stop()
    assert not Path(path).exists()


def test_a_socket_in_use_is_not_replaced(hub: RunningHub) -> None:
    with pytest.raises(BusUnavailable, match=rf"a hub \(process {os.getpid()}\) already serves this address"):
        Hub(hub.path)
    hub.connect().close()


def test_a_file_that_is_no_socket_is_left_alone(path: str) -> None:
    Path(path).write_text("precious")
    with pytest.raises(BusUnavailable, match="not a socket"):
        Hub(path)
    assert Path(path).read_text() == "precious"


def test_a_hub_does_not_remove_the_socket_of_its_successor(path: str) -> None:
    first = Hub(path)
    Path(path).unlink()
    second = RunningHub(path)
    first.close()
    assert stat.S_ISSOCK(Path(path).stat().st_mode)
    second.connect().close()
    second.stop()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        (
            "missing/hub",
            "missing: the hub's socket cannot be made there: No such file or directory; mkdir -p /",
        ),
        ("x" * 120, "too long for a socket's name, at most 107; use a shorter path"),
    ],
)
def test_addresses_that_cannot_be_served_say_why(tmp_path: Path, name: str, says: str) -> None:
    with pytest.raises(BusUnavailable, match=says):
        Hub(str(tmp_path / name))


def test_a_missing_hub_is_named_with_its_remedy(path: str) -> None:
    with pytest.raises(
        BusUnavailable,
        match=rf"there is no hub; start one there first \(loaderhil hub --bus hub:{path}\)",
    ):
        HubTransport(path)
    left = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    left.bind(path)
    left.close()
    with pytest.raises(BusUnavailable, match="no hub listens there"):
        HubTransport(path)


def test_a_name_in_use_without_a_file_is_refused_too() -> None:
    name = f"@loaderhil-test-{os.getpid()}"
    running = RunningHub(name)
    try:
        with pytest.raises(BusUnavailable, match=rf"a hub \(process {os.getpid()}\) already serves"):
            Hub(name)
    finally:
        running.stop()


def test_a_socket_of_another_kind_is_not_taken_for_a_hub(path: str) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as other:
        other.bind(path)
        other.listen()
        with pytest.raises(BusUnavailable, match="no hub, or one of an older loaderhil"):
            HubTransport(path)
        with pytest.raises(BusUnavailable, match="in the way, and protocol wrong type"):
            Hub(path)


def test_a_hub_that_is_stopped_is_not_waited_for_for_ever(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bus.hub.client.ANSWER_S", 0.05)
    hub = Hub(path)  # listens, and nobody runs it
    with hub, pytest.raises(BusUnavailable, match=r"does not answer within 0\.05 s; is it stopped"):
        HubTransport(path)


def test_something_else_at_the_address_is_not_taken_for_a_hub(path: str) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as other:
        other.bind(path)
        other.listen()
        answer = threading.Thread(target=lambda: other.accept()[0].close())
        answer.start()
        with pytest.raises(BusUnavailable, match="does not behave like a hub"):
            HubTransport(path)
        answer.join()


@pytest.mark.parametrize(
    ("first", "reason"),
    [
        (packet.pack(Frame(1, b"")), "first message must be a hello"),
        (b"GET / HTTP/1.1\r\n".ljust(packet.SIZE, b"x"), "first message must be a hello"),
        (saying(b"rubbish"), "no control message: Expecting value"),
        (saying(b"[]"), "a JSON list, not an object"),
        (saying(b"[" * 1255), "nested more than 8 deep"),
        (saying(b'{"hello": ' + b"[" * 1000), "nested more than 8 deep"),
        (saying(b'{"hello": 1' + b"0" * 1200 + b"}"), "protocol None spoken"),
        (saying(b'{"hello": "\xff"}'), "not UTF-8: byte 11 is 0xFF"),
        (saying(b'{"hello": NaN}'), "NaN is no JSON number"),
        (saying(b"{}"), "unknown control message with keys none"),
        (saying(b"{" + bytes(CONTROL_LIMIT)), "a control message of 1512 bytes; at most 1344 are taken"),
        (packet.control({"hello": "old", "protocol": 0}), "protocol 0 spoken, 2 wanted"),
    ],
)
def test_a_client_that_speaks_nonsense_gets_the_reason_and_loses_its_connection(
    hub: RunningHub, first: bytes, reason: str
) -> None:
    with hub.connect() as bystander, raw(hub.path) as client:
        client.send(first)
        assert reason in hear(client)["refused"]
        with contextlib.suppress(ConnectionResetError):  # it left some of what we said unread
            assert client.recv(1000) == b""
        assert bystander.drain() == []
        assert len(hub_status(hub.path).clients) == 1, "the hub serves on"


def test_connections_that_say_nothing_do_not_shut_others_out(hub: RunningHub) -> None:
    """Three hundred of them: more than a process may have open where `ulimit -n` is 256."""
    with contextlib.ExitStack() as stack:
        silent = [stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) for _ in range(300)]
        for client in silent:
            client.connect(hub.path)
        silent[-SILENT_LIMIT - 1].settimeout(WAIT_S)
        assert silent[-SILENT_LIMIT - 1].recv(1) == b"", "all but the newest have been closed"
        with hub.connect() as one, hub.connect() as other:
            one.send(Frame(1, b""))
            assert collect(other, 1)


def test_a_name_that_would_steer_a_terminal_is_shown_as_text(hub: RunningHub) -> None:
    with HubTransport(hub.path, name="\x1b[2J\ud800" + "n" * 500):
        (client,) = hub_status(hub.path).clients
    assert client.name.startswith("\\x1b[2J\\ud800nnn")
    assert len(client.name) < 100


def test_malformed_frames_are_refused_and_counted(hub: RunningHub) -> None:
    with hub.connect() as receiver, raw(hub.path) as client:
        greet(client, "bad")
        for length, flags in ((9, 0), (65, 4), (255, 4), (13, 4)):
            client.send(packet.LAYOUT.pack(1, length, flags, 0, b"", 0, 0))
        client.send(packet.pack(Frame(2, b"good")))
        assert unstamped(collect(receiver, 1)) == [Frame(2, b"good")]
        status = next(entry for entry in hub_status(hub.path).clients if entry.name == "bad")
        assert (status.sent, status.malformed) == (1, 4)


def test_one_client_too_many_is_refused(hub: RunningHub) -> None:
    with contextlib.ExitStack() as clients:
        for _ in range(CLIENT_LIMIT):
            clients.enter_context(hub.connect())
        with pytest.raises(BusUnavailable, match=f"already has {CLIENT_LIMIT} clients"):
            hub.connect()


@given(st.dictionaries(st.text(), st.integers() | st.text(max_size=300), max_size=3))
def test_control_messages_are_whole_records_that_no_frame_is_taken_for(message: dict[str, object]) -> None:
    records = packet.control(message)
    assert len(records) % packet.SIZE == 0
    assert packet.control_size(records) == len(records)
    assert packet.read_control(records) == message
    assert not packet.carries(records)


@given(classic | remote | fd)
def test_frames_are_records_that_no_control_message_is_taken_for(frame: Frame) -> None:
    assert packet.control_size(packet.pack(frame)) == 0
    assert packet.carries(packet.pack(frame))


def in_pieces(data: bytes, sizes: Iterable[int]) -> Iterator[bytes]:
    """The data cut into pieces of these sizes, again and again."""
    at = 0
    for size in itertools.cycle(sizes):
        if at >= len(data):
            return
        yield data[at : at + size]
        at += size


pieces = st.lists(st.integers(1, 3 * packet.SIZE), min_size=1, max_size=5)


def test_a_stream_may_be_cut_anywhere_on_its_way_to_the_hub(hub: RunningHub) -> None:
    hello = packet.control({"hello": "x" * 200, "protocol": packet.PROTOCOL})
    malformed = packet.LAYOUT.pack(1, 9, 0, 0, b"", 0, 0)

    @given(st.lists(classic | remote | fd, min_size=1, max_size=20), pieces)
    @settings(deadline=None, max_examples=30)
    def law(frames: list[Frame], sizes: list[int]) -> None:
        data = hello + malformed.join(packet.pack(frame) for frame in frames)
        with hub.connect() as receiver, raw(hub.path) as client:
            for piece in in_pieces(data, sizes):
                client.send(piece)
            assert unstamped(collect(receiver, len(frames))) == frames
            assert hear(client) == {"welcome": packet.PROTOCOL}

    law()


def test_a_stream_may_be_cut_anywhere_on_its_way_to_a_client(path: str) -> None:
    """A hub by hand, whose socket takes its records in pieces."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(path)
        listener.listen()

        @given(st.lists(classic | fd, min_size=1, max_size=20), pieces)
        @settings(deadline=None, max_examples=30)
        def law(frames: list[Frame], sizes: list[int]) -> None:
            answer = threading.Thread(target=lambda: accepted.append(welcomed(listener)))
            accepted: list[socket.socket] = []
            answer.start()
            client = HubTransport(path)
            answer.join()
            seen = []
            with client, accepted[0] as ours:
                refusal = packet.control({"refused": "enough " * 30})
                for piece in in_pieces(b"".join(map(packet.pack, frames)), sizes):
                    ours.send(piece)
                    seen += client.drain()
                ours.send(refusal)
                assert seen + client.drain() == frames
                with pytest.raises(BusClosed, match="the hub ended the connection: enough enough"):
                    client.drain()

        law()


def welcomed(listener: socket.socket) -> socket.socket:
    """The next client, greeted as a hub does."""
    connection, _ = listener.accept()
    assert "hello" in hear(connection)
    connection.send(packet.control({"welcome": packet.PROTOCOL}))
    return connection


def test_what_a_slow_client_can_lose_is_bounded_by_its_backlog(hub: RunningHub) -> None:
    """A pause of a second at full load of several buses loses nothing, whatever the kernel's limits are."""
    with hub.connect() as sender, hub.connect() as sleeper, hub.connect() as reader:
        for _ in range(BACKLOG_LIMIT // 64):
            for frame in numbered(64):
                assert sender.send(frame)
            collect(reader, 64)
        assert unstamped(collect(sleeper, BACKLOG_LIMIT)) == numbered(64) * (BACKLOG_LIMIT // 64)


def test_a_bit_rate_makes_the_hub_as_slow_as_a_bus_with_the_lowest_identifier_first(path: str) -> None:
    """Ends of frames are at least their own length apart, and what waits is sent by priority."""
    running, carried_s = RunningHub(path, bit_rate=20_000), 0.0
    try:
        with running.connect() as low, running.connect() as high, running.connect() as receiver:
            sent_in_time = False
            while not sent_in_time:  # else this thread was held up until the wire was free again
                before_ns = time.monotonic_ns()
                for index in range(10):
                    low.send(Frame(0x700, bytes([index] * 8)))
                high.send(Frame(0x010, b"urgent"))
                sent_in_time = time.monotonic_ns() - before_ns < 5 * duration_ns(
                    Frame(0x700, bytes(8)), 20_000
                )
                frames = collect(receiver, 11)
                carried_s += sum(duration_ns(frame, 20_000) for frame in frames) * 1e-9
            for earlier, later in itertools.pairwise(frames):
                assert later.at_ns - earlier.at_ns >= duration_ns(later, 20_000)
            assert [frame.data[0] for frame in frames if frame.can_id == 0x700] == list(range(10))
            assert frames[-1].can_id == 0x700  # the urgent frame came last and was not carried last
            status = hub_status(path)
            assert status.bit_rate == 20_000
            assert status.busy_s == pytest.approx(carried_s)
    finally:
        running.stop()


def test_a_client_that_floods_a_slow_bus_is_held_back_and_loses_nothing(path: str) -> None:
    """More than the hub queues for one client waits in its socket; it may even leave meanwhile."""
    running = RunningHub(path, bit_rate=1_000_000)
    try:
        with running.connect() as receiver:
            with running.connect() as flood:
                for frame in numbered(500):
                    assert flood.send(frame)
            assert unstamped(collect(receiver, 500)) == numbered(500)
    finally:
        running.stop()


def test_the_hub_stops_reading_from_a_client_whose_frames_wait_for_the_wire(path: str) -> None:
    running = RunningHub(path, bit_rate=5_000)
    try:
        with running.connect() as flood:
            for frame in numbered(10 * WAITING_LIMIT):
                assert flood.send(frame)
            waiting = [hub_status(path).clients[0].waiting for _ in range(50)]
            assert max(waiting) == WAITING_LIMIT
    finally:
        running.stop()


def test_stamps_strictly_increase_even_when_the_clock_does_not(
    path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bus.hub.server.time", SimpleNamespace(monotonic_ns=lambda: 1_000))
    running = RunningHub(path)
    try:
        with running.connect() as sender, running.connect() as receiver:
            for frame in numbered(3):
                sender.send(frame)
            assert [frame.at_ns for frame in collect(receiver, 3)] == [1_001, 1_002, 1_003]
    finally:
        running.stop()


SERVE = "import sys; from bus.hub.server import serve; serve(sys.argv[1], on_ready=lambda: print('ready', flush=True))"


@pytest.mark.processes
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_hub_process_and_leaves_nothing_behind(path: str, number: signal.Signals) -> None:
    with subprocess.Popen([sys.executable, "-c", SERVE, path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        with HubTransport(path) as client:
            process.send_signal(number)
            assert process.wait(WAIT_S) == 0
            with pytest.raises(BusClosed):
                client.drain()
    assert not Path(path).exists()


@pytest.mark.processes
def test_a_killed_hub_is_noticed_and_its_address_can_be_served_again(path: str) -> None:
    with subprocess.Popen([sys.executable, "-c", SERVE, path], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with HubTransport(path) as client:
            process.kill()
            assert readable(client, WAIT_S)
            with pytest.raises(BusClosed, match="the hub is gone"):
                client.drain()
    running = RunningHub(path)
    running.connect().close()
    running.stop()
