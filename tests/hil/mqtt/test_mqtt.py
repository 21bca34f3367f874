"""The bridge as a process between a hub and Debian's mosquitto."""

import asyncio
import json
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiomqtt
import cantools
import pytest

from bus.frame import Frame
from bus.hub.client import hub_status
from bus.hub.peer import BACKLOG_LIMIT
from dbc import FOLDER
from hil.faults.control import ControlServer
from tests.bus.hub.running import RunningHub
from tests.bus.laws import numbered
from tests.hil.monitor.test_monitor_command import send_all
from tests.hil.monitor.traffic import can_id_of, machine_frames

pytestmark = [pytest.mark.mqtt, pytest.mark.processes]
WAIT_S = 60.0
"""For a process to start on a busy machine, or a message to come; what takes longer hangs."""
MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


class RunningBroker:
    """A mosquitto without a memory, on a free port of this machine."""

    def __init__(self) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port: int = probe.getsockname()[1]
        self.start()

    def start(self) -> None:
        assert MOSQUITTO is not None
        self.process = subprocess.Popen(
            [MOSQUITTO, "-p", str(self.port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        wait(self._listens)

    def _listens(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    def stop(self) -> None:
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        self.process.wait(WAIT_S)


def wait(ready: Callable[[], bool]) -> None:
    deadline = time.monotonic() + WAIT_S
    while not ready():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.fixture
def broker() -> Iterator[RunningBroker]:
    if MOSQUITTO is None:
        pytest.skip("mosquitto is missing: install it")
    running = RunningBroker()
    yield running
    running.stop()


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[RunningHub]:
    running = RunningHub(str(tmp_path / "bench.hub"))
    yield running
    running.stop()


class RunningBridge:
    """`loaderhil mqtt` between them."""

    def __init__(self, hub: RunningHub, broker: RunningBroker, *words: object) -> None:
        self.hub = hub
        command = [sys.executable, "-m", "loaderhil", "mqtt", "--bus", f"hub:{hub.path}"]
        command += ["--broker", f"127.0.0.1:{broker.port}", "--every-ms", "20", *map(str, words)]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        wait(lambda: self.client() is not None)

    def client(self) -> Any:
        return next((client for client in hub_status(self.hub.path).clients if client.name == "mqtt"), None)

    def end(self, number: int = signal.SIGINT) -> str:
        """What it said."""
        self.process.send_signal(number)
        with self.process:
            assert self.process.stderr is not None
            return self.process.stderr.read()


@pytest.fixture
def bridge(hub: RunningHub, broker: RunningBroker) -> Iterator[RunningBridge]:
    running = RunningBridge(hub, broker)
    yield running
    if running.process.poll() is None:
        running.end(signal.SIGKILL)


@asynccontextmanager
async def heard(broker: RunningBroker, *topics: str) -> AsyncIterator[AsyncIterator[aiomqtt.Message]]:
    """Messages on these topics; a test failure if they do not come in time."""
    async with asyncio.timeout(WAIT_S), aiomqtt.Client("127.0.0.1", broker.port) as client:
        for topic in topics:
            await client.subscribe(topic, qos=1)
        yield aiter(client.messages)


async def next_on(broker: RunningBroker, topic: str, ready: Callable[[Any], bool] = lambda _: True) -> Any:
    """The first payload on a topic that `ready` accepts."""
    async with heard(broker, topic) as messages:
        async for message in messages:
            payload = message.payload.decode()
            value = json.loads(payload) if payload.startswith("{") else payload
            if ready(value):
                return value
    raise AssertionError


def test_every_message_is_retained_with_cantools_values(
    bridge: RunningBridge, hub: RunningHub, broker: RunningBroker
) -> None:
    frames = machine_frames()
    send_all(hub, list(frames))
    last = {frame.can_id: frame for frame in frames}
    reference = cantools.database.load_file(FOLDER / "loader.dbc")
    expected = {}
    for frame in last.values():
        message = reference.get_message_by_frame_id(frame.identifier)
        values = message.decode(frame.data, decode_choices=False)
        shown = {name: value for name, value in values.items() if name not in ("Crc", "AliveCounter")}
        expected[message.name] = shown if "Crc" in values else values

    async def check() -> None:
        async with heard(broker, "loaderhil/bus/bench/+") as messages:
            states: dict[str, Any] = {}
            while (
                not expected.keys() <= states.keys()
                or {
                    name: {signal: state["value"] for signal, state in states[name]["signals"].items()}
                    for name in expected
                }
                != expected
            ):
                message = await anext(messages)
                states[str(message.topic).rpartition("/")[2]] = json.loads(message.payload)
        articulation = states["Articulation"]
        assert articulation["signals"]["ArticulationAngle"]["unit"] == "deg"
        assert abs(articulation["time_s"] - time.time()) < WAIT_S

    asyncio.run(check())
    assert asyncio.run(next_on(broker, "loaderhil/bridge/status")) == "online"
    statistics = asyncio.run(
        next_on(broker, "loaderhil/bridge/statistics", lambda state: state["frames"] == len(frames))
    )
    assert statistics["lost"] == {"bench": 0}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_however_it_ends_the_broker_says_offline(
    bridge: RunningBridge, broker: RunningBroker, number: int
) -> None:
    async def check() -> None:
        async with heard(broker, "loaderhil/bridge/status") as messages:
            status = ""
            while status != "online":
                status = (await anext(messages)).payload.decode()
            said.append(await asyncio.to_thread(bridge.end, number))
            assert (await anext(messages)).payload == b"offline"

    said: list[str] = []
    asyncio.run(check())
    lines = said[0].splitlines()
    assert lines[0] == f"loaderhil: connected to 127.0.0.1:{broker.port}"
    if number == signal.SIGINT:
        assert lines[1:] == ["loaderhil: interrupted after 0 frames"]
        assert bridge.process.returncode == 130


def test_a_broker_that_comes_back_without_memory_is_reported_everything_again(
    bridge: RunningBridge, hub: RunningHub, broker: RunningBroker
) -> None:
    topic, can_id = "loaderhil/bus/bench/LiftPressure", can_id_of("LiftPressure")
    send_all(hub, [Frame(can_id, b"\1\0" + bytes(6))])
    before = asyncio.run(next_on(broker, topic))
    broker.stop()
    broker.start()
    assert asyncio.run(next_on(broker, topic)) == before
    broker.stop()
    send_all(hub, [Frame(can_id, b"\2\0" + bytes(6))])
    broker.start()
    after = asyncio.run(next_on(broker, topic, lambda state: state["time_s"] != before["time_s"]))
    assert after["signals"]["LiftCylinderPressure"]["value"] == 4
    lines = bridge.end().splitlines()
    assert sum("no broker at" in line for line in lines) == 2
    assert sum("connected to" in line for line in lines) == 3


def test_a_broker_that_hangs_never_holds_up_the_bus(
    bridge: RunningBridge, hub: RunningHub, broker: RunningBroker
) -> None:
    asyncio.run(next_on(broker, "loaderhil/bridge/status", lambda state: state == "online"))
    broker.process.send_signal(signal.SIGSTOP)
    rounds = BACKLOG_LIMIT // 500  # what the hub holds for a bridge that the host lets wait
    for _ in range(rounds):
        send_all(hub, [Frame(can_id_of("LiftPressure"), bytes(8)) for _ in range(500)])
    send_all(hub, [Frame(can_id_of("LiftPressure"), b"\3\0" + bytes(6))])
    wait(lambda: bridge.client().delivered == rounds * 500 + 1)
    assert bridge.client().dropped == 0
    broker.process.send_signal(signal.SIGCONT)
    newest = asyncio.run(
        next_on(
            broker,
            "loaderhil/bus/bench/LiftPressure",
            lambda state: state["signals"]["LiftCylinderPressure"]["value"] == 6,
        )
    )
    assert newest["message"] == "LiftPressure"


def test_findings_are_events(bridge: RunningBridge, hub: RunningHub, broker: RunningBroker) -> None:
    async def check() -> list[tuple[str, str]]:
        async with heard(broker, "loaderhil/findings") as messages:
            await asyncio.to_thread(send_all, hub, [Frame(can_id_of("Articulation"), b"\1" + bytes(7))])
            events = []
            while ("Articulation", "stale") not in events:
                event = json.loads((await anext(messages)).payload)
                events.append((event["message"], event["finding"]))
            return events

    events = asyncio.run(check())
    assert any(message == "Articulation" and "CRC" in finding for message, finding in events)


def test_commands_reach_the_gateway_once(hub: RunningHub, broker: RunningBroker, tmp_path: Path) -> None:
    control, key = tmp_path / "control", tmp_path / "key"
    key.write_text("0123456789abcdef\n")
    obeyed: list[Any] = []

    def obey(request: Any) -> dict[str, Any]:
        obeyed.append(dict(request))
        return {"ok": True, "number": len(obeyed)}

    async def ask() -> list[Any]:
        async with (
            heard(broker, "loaderhil/reply") as messages,
            aiomqtt.Client("127.0.0.1", broker.port) as sender,
        ):
            answers = []
            for payload, retain in (
                ('{"command": "list", "id": "a"}', True),  # there before the bridge, and obeyed by nobody
                (
                    '{"command": "inject", "fault": {"kind": "drop", "message": "BodyRates"}, "id": 2, '
                    '"key": "0123456789abcdef"}',
                    False,
                ),
                ("rubbish", False),
                ("[" * 20_000, False),
                ('{"command": "list"}', False),
            ):
                await sender.publish("loaderhil/command", payload, qos=1, retain=retain)
                if retain:
                    running.append(RunningBridge(hub, broker, "--control", control, "--command-key", key))
                answers.append(json.loads((await anext(messages)).payload))
            return answers

    running: list[RunningBridge] = []
    with ControlServer(control, obey) as server:
        serving = threading.Event()

        def serve() -> None:
            while not serving.wait(0.01):
                server.serve()

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            answers = asyncio.run(ask())
        finally:
            serving.set()
            thread.join()
            for bridge in running:
                bridge.end()
    assert answers[0] == {"ok": False, "error": "a retained command is not obeyed"}
    assert answers[1] == {"ok": True, "number": 1, "id": 2}
    assert [answer["ok"] for answer in answers[2:]] == [False, False, False]
    assert answers[4]["error"] == "the key is missing or wrong"
    assert obeyed == [{"command": "inject", "fault": {"kind": "drop", "message": "BodyRates"}}]


def test_the_end_of_the_bus_ends_it(tmp_path: Path, broker: RunningBroker) -> None:
    hub = RunningHub(str(tmp_path / "ending.hub"))
    bridge = RunningBridge(hub, broker)
    send_all(hub, numbered(3))
    asyncio.run(next_on(broker, "loaderhil/bridge/status", lambda state: state == "online"))
    hub.stop()
    with bridge.process:
        assert bridge.process.stderr is not None
        said = bridge.process.stderr.read()
    assert bridge.process.returncode == 4
    assert said.splitlines()[-1] == f"loaderhil: lost the bus: {hub.path}: the hub is gone"
    assert asyncio.run(next_on(broker, "loaderhil/bridge/status")) == "offline"


def test_misuse_is_one_line() -> None:
    for words, says in (
        (("--broker", "host:none"), "broker 'host:none': write HOST:PORT"),
        (("--prefix", "a/#"), "--prefix 'a/#': a topic must not be empty"),
        (("--control", "/tmp/nowhere"), "--control and --command-key belong together"),
        (("--password-file", __file__), "--password-file needs --user"),
        (("-m", "Nothing"), "no message 'Nothing'"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "loaderhil", "mqtt", *words],
            capture_output=True,
            text=True,
            check=False,
            timeout=WAIT_S,
        )
        assert done.returncode == 2
        assert done.stderr.startswith(f"loaderhil: {says}")
        assert done.stderr.count("\n") == 1
