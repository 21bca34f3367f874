"""The bridge between buses and a broker: an optional process that the bus never waits for.

Two tasks: one takes every frame that arrives, whatever the broker does; the other tells the broker the newest state a
few times per second, for as long as there is one, and looks for it again when it is gone.
"""

import asyncio
import contextlib
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import aiomqtt

from bus import wallclock
from bus.mistake import Mistake
from bus.transport import BusClosed
from hil.faults.control import ask
from hil.monitor.board import Board
from hil.monitor.source import Buses
from hil.mqtt.publications import Publisher, Topics

RETRY_S = (0.2, 5.0)
"""Pause before the broker is looked for again: the first, doubled up to the last."""
ANSWER_S = 5.0
KEEPALIVE_S = 10
STATISTICS_S = 1.0
COMMANDS_WAITING = 64
"""Commands that may wait for their turn; more are dropped."""
ONLINE, OFFLINE = "online", "offline"


class BrokerError(Mistake, ValueError):
    """An address that names no broker."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Broker:
    """Where the broker listens."""

    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> "Broker":
        """`HOST:PORT`, `HOST` or `[ADDRESS]:PORT`; BrokerError for anything else."""
        host, separator, port = text.rpartition(":") if not text.endswith("]") else (text, "", "")
        if not separator:
            host, port = text, "1883"
        host = host.removeprefix("[").removesuffix("]")
        if not host or not port.isdecimal() or not 0 < int(port) < 65536:
            raise BrokerError(
                f"broker '{text}': write HOST:PORT with a port from 1 to 65535, such as localhost:1883"
            )
        return cls(host=host, port=int(port))

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class Bridge:
    """Buses on one side, a broker on the other."""

    def __init__(
        self,
        buses: Buses,
        board: Board,
        broker: Broker,
        topics: Topics,
        *,
        every_s: float,
        control: Path | None,
    ) -> None:
        """every_s: how often a message is told at most; control: socket of the gateway that obeys commands."""
        self._buses, self._board, self._broker, self._topics = buses, board, broker, topics
        self._every_s, self._control = every_s, control
        self._publisher = Publisher(topics)
        self._published = self._connections = 0
        self._alone = False

    @property
    def frames(self) -> int:
        """Frames taken from the buses."""
        return self._board.frames

    async def run(self) -> None:
        """Until cancelled; BusClosed when a bus ends."""
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._listen(), name="mqtt-listen")
                tasks.create_task(self._tell(), name="mqtt-tell")
        except BaseExceptionGroup as group:
            closed, others = group.split(BusClosed)
            if closed is None or others is not None:
                raise
            raise closed.exceptions[0] from None

    async def _listen(self) -> None:
        """Every frame that arrives, as soon as it does."""
        loop = asyncio.get_running_loop()
        ended: asyncio.Future[None] = loop.create_future()

        def readable() -> None:
            try:
                for name, frame in self._buses.drain():
                    self._board.take(name, frame)
            except BusClosed as error:
                loop.remove_reader(self._buses.fileno())
                ended.set_exception(error)

        loop.add_reader(self._buses.fileno(), readable)
        try:
            await ended
        finally:
            loop.remove_reader(self._buses.fileno())

    async def _tell(self) -> None:
        """A connection to the broker after the other."""
        pause_s = RETRY_S[0]
        while True:
            before = self._connections
            try:
                await self._connected()
            except* aiomqtt.MqttError as errors:
                self._note_loss(errors.exceptions[0])
            if self._connections > before:
                pause_s = RETRY_S[0]
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, RETRY_S[1])

    def _note_loss(self, error: BaseException) -> None:
        """Say once that there is no broker."""
        if not self._alone:
            self._alone = True
            say(f"no broker at {self._broker} ({error}); trying again, newer values replace older ones")

    async def _connected(self) -> None:
        """One connection, from its first to its last message."""
        will = aiomqtt.Will(self._topics.status, OFFLINE, qos=1, retain=True)
        async with aiomqtt.Client(
            self._broker.host,
            self._broker.port,
            will=will,
            timeout=ANSWER_S,
            keepalive=KEEPALIVE_S,
            max_queued_incoming_messages=COMMANDS_WAITING,
        ) as client:
            self._connections += 1
            self._alone = False
            self._publisher.renew()
            say(f"connected to {self._broker}")
            try:
                async with asyncio.TaskGroup() as tasks:
                    tasks.create_task(self._publish(client), name="mqtt-publish")
                    if self._control is not None:
                        tasks.create_task(self._obey(client, self._control), name="mqtt-obey")
            except asyncio.CancelledError:
                with contextlib.suppress(aiomqtt.MqttError):
                    await client.publish(self._topics.status, OFFLINE, qos=1, retain=True)
                raise

    async def _publish(self, client: aiomqtt.Client) -> None:
        """What is new, again and again; while the broker does not take it, nothing piles up here."""
        await client.publish(self._topics.status, ONLINE, qos=1, retain=True)
        statistics_due = 0.0
        while True:
            started, now_ns = time.monotonic(), time.monotonic_ns()
            rows = self._board.rows(now_ns)
            for publication in self._publisher.due(rows, now_ns + wallclock.SHARED.ahead_ns):
                await client.publish(publication.topic, publication.payload, qos=0, retain=publication.retain)
                self._published += 1
            if started >= statistics_due:
                statistics_due = started + STATISTICS_S
                await client.publish(self._topics.statistics, json.dumps(self._statistics()), retain=True)
            await asyncio.sleep(max(0.0, started + self._every_s - time.monotonic()))

    def _statistics(self) -> dict[str, Any]:
        return {
            "frames": self._board.frames,
            "lost": self._buses.lost(),
            "published": self._published,
            "superseded": self._publisher.superseded,
            "connections": self._connections,
        }

    async def _obey(self, client: aiomqtt.Client, control: Path) -> None:
        """Commands to the gateway's control socket, one after the other, and its answers."""
        await client.subscribe(self._topics.command, qos=1)
        async for message in client.messages:
            if message.retain:  # it would be obeyed again after every reconnection
                answer: dict[str, Any] = {"ok": False, "error": "a retained command is not obeyed"}
            else:
                answer = await asyncio.to_thread(obey, control, message.payload)
            await client.publish(self._topics.reply, json.dumps(answer), qos=1)


def obey(control: Path, payload: Any) -> dict[str, Any]:
    """The control socket's answer to a command; `id`, if the command has one, comes back with it."""
    try:
        command = json.loads(payload)
    except (ValueError, TypeError) as error:
        return {"ok": False, "error": f"not JSON: {error}"}
    if not isinstance(command, dict):
        return {"ok": False, "error": "a command is a JSON object, as `loaderhil inject` sends it"}
    number = {"id": command.pop("id")} if "id" in command else {}
    try:
        return ask(control, command) | number
    except Mistake as error:
        return {"ok": False, "error": str(error)} | number


def say(text: str) -> None:
    """One line for whoever started the bridge."""
    print(f"loaderhil: {text}", file=sys.stderr)
