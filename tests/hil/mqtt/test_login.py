"""Login, TLS and commands of the bridge: against the first packet of a real connection, and against any payload."""

import asyncio
import json
import shutil
import socket
import ssl
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import aiomqtt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.mqtt.broker import Broker, BrokerError, read_secret, tls_context
from hil.mqtt.commands import Commands, KeyTooShort

KEY = "a key of this very bench"
NOWHERE = Path("/nowhere/control")


@pytest.mark.parametrize(
    "payload",
    [
        b"[" * 20_000,
        b'{"id": ' + b"[" * 4_000,
        b"9" * 100_000,
        b"\xff\x00",
        "text",
        None,
        3.0,
        b'{"key": "\\ud800"}',
    ],
)
def test_no_payload_of_a_command_raises(payload: Any) -> None:
    answer = Commands(NOWHERE, KEY).obey(payload)
    assert answer["ok"] is False
    json.dumps(answer)


@given(
    st.binary()
    | st.recursive(st.none() | st.text() | st.integers(), st.lists).map(
        lambda v: json.dumps({"key": KEY, "id": v}).encode()
    )
)
def test_any_payload_is_answered(payload: bytes) -> None:
    assert Commands(NOWHERE, KEY).obey(payload)["ok"] is False


@pytest.mark.parametrize("key", [None, "", "A key of this very bench", KEY + " ", 7, [KEY]])
def test_a_command_without_the_key_reaches_no_gateway(key: object) -> None:
    command = {"command": "list", "id": 4} | ({} if key is None else {"key": key})
    answer = Commands(NOWHERE, KEY).obey(json.dumps(command).encode())
    assert answer == {"ok": False, "error": "the key is missing or wrong", "id": 4}


def test_a_command_with_the_key_reaches_the_control_socket() -> None:
    answer = Commands(NOWHERE, KEY).obey(json.dumps({"command": "list", "key": KEY}).encode())
    assert "nobody listens" in answer["error"]


def test_a_key_that_can_be_guessed_is_refused() -> None:
    with pytest.raises(KeyTooShort, match="at least 16"):
        Commands(NOWHERE, "short")


def test_secrets_are_not_shown(tmp_path: Path) -> None:
    broker = Broker.parse("bench:1883", user="bench", password="geheim")
    assert "geheim" not in repr(broker)
    assert KEY not in repr(Commands(NOWHERE, KEY))
    (tmp_path / "empty").write_text("\n")
    for file in ("empty", "missing"):
        with pytest.raises(BrokerError, match="--password-file"):
            read_secret("--password-file", tmp_path / file)


def test_wrong_certificates_are_one_line_naming_the_file(tmp_path: Path) -> None:
    (tmp_path / "ca.pem").write_text("no certificate")
    with pytest.raises(BrokerError, match=r"ca\.pem: cannot be used for TLS"):
        tls_context(tmp_path / "ca.pem", None, None)
    with pytest.raises(BrokerError, match="belong together"):
        tls_context(None, tmp_path / "ca.pem", None)


def first_packet(server: socket.socket, context: ssl.SSLContext | None, heard: list[bytes]) -> None:
    """Accept one client, keep its CONNECT, and say that its login is wrong (MQTT 3.1.1, 3.2.2.3)."""
    connection, _ = server.accept()
    with connection:
        try:
            with context.wrap_socket(connection, server_side=True) if context else connection as stream:
                heard.append(stream.recv(1000))
                stream.sendall(b"\x20\x02\x00\x05")
        except ssl.SSLError as error:
            heard.append(str(error).encode())


@pytest.fixture
def certificate(tmp_path: Path) -> Path:
    """A certificate of 127.0.0.1 that is its own authority, and its key, in one file."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is missing: install it")
    file = tmp_path / "broker.pem"
    words = [
        "-newkey",
        "rsa:2048",
        "-nodes",
        "-subj",
        "/CN=127.0.0.1",
        "-addext",
        "subjectAltName=IP:127.0.0.1",
    ]
    subprocess.run(
        ["openssl", "req", "-x509", *words, "-days", "2", "-keyout", file, "-out", tmp_path / "certificate"],
        check=True, capture_output=True,
    )  # fmt: skip
    file.write_text(file.read_text() + (tmp_path / "certificate").read_text())
    return file


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(30)
        yield listening


def connect(
    server: socket.socket, context: ssl.SSLContext | None, trusted: ssl.SSLContext | None
) -> tuple[bytes, str]:
    """What the broker hears first from the bridge's client, and what the client makes of its answer."""
    port = server.getsockname()[1]
    broker = Broker.parse(f"127.0.0.1:{port}", user="bench", password="geheim", tls=trusted)
    heard: list[bytes] = []
    thread = threading.Thread(target=first_packet, args=(server, context, heard))
    thread.start()

    async def session() -> str:
        try:
            async with aiomqtt.Client(**broker.options(), timeout=10):
                return "connected"
        except aiomqtt.MqttError as error:
            return str(error)

    said = asyncio.run(session())
    thread.join()
    return heard[0], said


def test_the_login_is_in_the_first_packet(server: socket.socket) -> None:
    packet, said = connect(server, None, None)
    assert packet[0] == 0x10
    assert b"\x00\x05bench\x00\x06geheim" in packet
    assert "Not authorized" in said


# paho leaves the TLS socket of a connection that the broker refused to the garbage collector.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_with_tls_only_a_broker_that_is_trusted_gets_the_login(
    server: socket.socket, certificate: Path
) -> None:
    theirs = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    theirs.load_cert_chain(certificate)
    packet, _ = connect(server, theirs, tls_context(certificate, None, None))
    assert b"geheim" in packet
    stranger, said = connect(server, theirs, tls_context(None, None, None))
    assert b"geheim" not in stranger
    assert "certificate verify failed" in said
