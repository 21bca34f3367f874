"""The hub's protocol: nonsense is refused with the reason, records survive being cut anywhere."""

import contextlib
import itertools
import socket
import threading
from collections.abc import Iterable, Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.frame import Frame
from bus.hub import packet
from bus.hub.client import HubTransport, hub_status
from bus.hub.server import CLIENT_LIMIT, CONTROL_LIMIT, SILENT_LIMIT
from bus.transport import BusClosed, BusUnavailable
from tests.bus.hub.running import RunningHub, greet, hear, raw, saying
from tests.bus.laws import WAIT_S, classic, collect, fd, remote, unstamped


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
