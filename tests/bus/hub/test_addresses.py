"""Where a hub can be served and found: files, names, other programs' sockets; each refusal says what to do."""

import os
import socket
import stat
import threading
from pathlib import Path

import pytest

from bus.frame import Frame
from bus.hub.client import HubTransport
from bus.hub.server import Hub
from bus.transport import BusUnavailable
from tests.bus.hub.running import RunningHub
from tests.bus.laws import collect


def test_a_name_without_a_file_works_too() -> None:
    running = RunningHub(f"@loaderhil-test-{os.getpid()}")
    try:
        with running.connect() as sender, running.connect() as receiver:
            sender.send(Frame(1, b"x"))
            assert len(collect(receiver, 1)) == 1
    finally:
        running.stop()


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
