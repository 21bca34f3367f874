"""Live commands arrive over the socket, are answered, and a wrong one is one line."""

import select
import socket
import threading
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hil.ending import Ending
from hil.faults.command import NoSuchValue, fault_table, seconds
from hil.faults.control import CLIENTS_LIMIT, ControlServer, ControlUnavailable, Refused, ask
from hil.faults.injector import FAULTS_LIMIT
from loaderhil.cli import app
from tests.hil.faults.traffic import MS, frames, injector


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a short name: the paths of tests are too long for sockets
    return Path("control")


@pytest.fixture
def served(path):
    """An injector behind a socket; the thread serves until the end of the test."""
    one = injector()
    done, wake = socket.socketpair()
    with ControlServer(path, lambda request: one.command(request, 1000 * MS)) as server, done, wake:

        def serve():
            while True:
                readable, _, _ = select.select([server, done], [], [])
                if done in readable:
                    return
                server.serve()

        thread = threading.Thread(target=serve)
        thread.start()
        yield one
        wake.send(b"end")
        thread.join()


@pytest.fixture
def inject(path):
    runner = CliRunner()
    return lambda *words: runner.invoke(app, ["inject", "--control", str(path), *words])


def test_a_command_reaches_the_injector_and_is_answered(path, served):
    answer = ask(path, {"command": "inject", "fault": {"kind": "drop", "message": "WheelSpeeds"}})
    assert answer["fault"] == "drop WheelSpeeds"
    (frame,) = frames("WheelSpeedsFront", 1)
    assert not served.pass_frame("plant", frame, 1000 * MS)


def test_a_refused_command_gives_the_reason(path, served):
    with pytest.raises(Refused, match=r"fault.probability = 2 of 1 is outside 0..1"):
        ask(path, {"command": "inject", "fault": {"kind": "drop", "probability": 2}})


def test_rubbish_or_a_lost_client_disturbs_nobody(path, served):
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as other:
        other.connect(str(path))
        other.send(b"\xff not json")
        assert b"not UTF-8" in other.recv(1000)
        other.send(b"[1, 2]")
        assert b"JSON object" in other.recv(1000)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as gone:
        gone.connect(str(path))
        gone.send(b'{"command": "list"}')
    assert ask(path, {"command": "list"}) == {"ok": True, "faults": []}


@pytest.mark.parametrize(
    "packet",
    [
        b"[" * 20_000,
        b'{"command": ' + b"[" * 7_000,
        b"9" * 20_000,
        b'{"command": "\\ud800"}',
        b'{"fault": -Infinity}',
    ],
)
def test_a_packet_of_any_size_and_depth_ends_nothing(path, served, packet):
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as other:
        other.connect(str(path))
        other.settimeout(5)
        other.send(packet)
        assert b'"ok": false' in other.recv(10_000)
    assert ask(path, {"command": "list"}) == {"ok": True, "faults": []}


def test_the_number_of_faults_is_limited(path, served):
    for _ in range(FAULTS_LIMIT):
        served.command({"command": "inject", "fault": {"kind": "drop", "message": "WheelSpeeds"}})
    with pytest.raises(Refused, match="at most 500"):
        ask(path, {"command": "inject", "fault": {"kind": "drop", "message": "WheelSpeeds"}})


def test_too_many_clients_are_sent_away_and_the_others_stay(path, served):
    kept = []
    for _ in range(CLIENTS_LIMIT):
        client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        client.connect(str(path))
        client.send(b'{"command": "list"}')
        assert client.recv(1000)
        kept.append(client)
    with pytest.raises(ControlUnavailable):
        ask(path, {"command": "list"})
    for client in kept:
        client.close()


def test_a_socket_left_by_a_killed_process_is_replaced_and_one_in_use_is_not(path):
    left = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    left.bind(str(path))
    left.close()
    with ControlServer(path, dict), pytest.raises(ControlUnavailable, match="somebody already listens"):
        ControlServer(path, dict)
    assert not path.exists()


def test_a_file_in_the_way_is_kept(path):
    path.write_text("mine")
    with pytest.raises(ControlUnavailable, match="not a socket"):
        ControlServer(path, dict)
    assert path.read_text() == "mine"


def test_a_name_too_long_for_a_socket_is_refused():
    with pytest.raises(ControlUnavailable, match="120 bytes are too long"):
        ask(Path("x" * 120), {})


@pytest.mark.parametrize(
    ("text", "expected"), [("2s", 2.0), ("250ms", 0.25), ("300us", 3e-4), ("1.5min", 90.0), (".5 s", 0.5)]
)
def test_durations(text, expected):
    assert seconds(text) == pytest.approx(expected)


@pytest.mark.parametrize("text", ["2", "s", "-1s", "1h", "1s2", ""])
def test_no_durations(text):
    with pytest.raises(NoSuchValue, match="is no duration"):
        seconds(text)


def test_options_become_a_table_in_its_units():
    said = {"kind": "babble", "for_s": "2s", "interval_us": "1ms", "identifier": "0x1F", "message": None}
    assert fault_table(said) == {"kind": "babble", "for_s": 2.0, "interval_us": 1000.0, "identifier": 31}
    assert fault_table({"signals": "Left,Right", "delay_ms": "2ms"}) == {
        "signals": ["Left", "Right"],
        "delay_ms": 2.0,
    }
    with pytest.raises(NoSuchValue, match="--identifier 'x'"):
        fault_table({"identifier": "x"})


def test_the_command_injects_lists_and_clears(inject, served):
    done = inject("drop", "WheelSpeeds", "--probability", "0.1", "--for", "2s")
    assert (done.exit_code, done.output) == (0, "fault 1: drop WheelSpeeds probability=0.1\n")
    assert inject("corrupt", "--valid-crc", "--in", "500ms").output == "fault 2: corrupt valid_crc=true\n"
    listed = inject("--list").output.splitlines()
    assert listed[0].split(maxsplit=6) == [
        "1",
        "ends",
        "in",
        "2.0",
        "s",
        "0",
        "frames  drop WheelSpeeds probability=0.1",
    ]
    assert "begins in 0.5 s" in listed[1]
    assert inject("--clear", "--number", "2").output == "cleared: 2\n"
    assert inject("--clear").output == "cleared: 1\n"
    assert inject("--clear").output == "cleared: no fault was active\n"


def test_the_order_of_the_options_does_not_matter(inject, served):
    options = ("--delay", "20ms"), ("--from", "ecu"), ("--for", "2s")
    for number, ordered in enumerate((options, options[::-1]), start=1):
        words = [word for option in ordered for word in option]
        assert (
            inject("delay", "Limits", *words).output
            == f"fault {number}: delay Limits from=ecu delay_ms=20.0\n"
        )


def test_without_a_gateway_the_command_says_so(inject):
    result = inject("--list")
    assert result.exit_code == Ending.HUB_LOST
    assert "nobody listens; start `loaderhil gateway --control control` first" in result.output


@pytest.mark.parametrize("words", [(), ("drop", "--list"), ("--list", "--clear")])
def test_it_is_one_thing_at_a_time(inject, words):
    assert inject(*words).exit_code == Ending.MISUSED
