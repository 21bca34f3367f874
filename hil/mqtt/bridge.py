"""The bridge between buses and an MQTT broker: an optional process that no bus ever waits for.

Two tasks: one takes every frame that arrives, whatever the broker does; the other publishes the newest state a
few times per second, and reconnects when the broker has gone.
"""

import asyncio
import contextlib
import json
import sys
import time
from typing import Any

import aiomqtt

from bus.socketcan import wallclock
from bus.transport import BusClosed
from hil.monitor.board import Board
from hil.monitor.source import Buses
from hil.mqtt.broker import Broker
from hil.mqtt.commands import Commands
from hil.mqtt.publications import Publisher, Topics

RETRY_S = (0.2, 5.0)
"""Pause before the next attempt to connect [s]: the first, doubled up to the last."""
ANSWER_S = 5.0
KEEPALIVE_S = 10
STATISTICS_S = 1.0
COMMANDS_WAITING = 64
"""Commands that may wait; more are dropped."""
ONLINE, OFFLINE = "online", "offline"


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
        commands: Commands | None,
    ) -> None:
        """every_s: shortest time between two publications of a message [s]; commands: None if none are accepted."""
        self._buses, self._board, self._broker, self._topics = buses, board, broker, topics
        self._every_s, self._commands = every_s, commands
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
                tasks.create_task(self._stay_connected(), name="mqtt-connection")
        except BaseExceptionGroup as group:
            closed, others = group.split(BusClosed)
            if closed is None or others is not None:
                raise
            raise closed.exceptions[0] from None

    async def _listen(self) -> None:
        """Take every frame as soon as it arrives, until a bus ends."""
        loop = asyncio.get_running_loop()
        ended: asyncio.Future[None] = loop.create_future()

        def readable() -> None:
            try:
                for name, frame in self._buses.drain():
                    self._board.take(name, frame)
            except BusClosed as error:
                loop.remove_reader(self._buses.fileno())
                ended.set_exception(error)

        # a reader of the loop, not a task that awaits: publishing to a slow broker must not delay it
        loop.add_reader(self._buses.fileno(), readable)
        try:
            await ended
        finally:
            loop.remove_reader(self._buses.fileno())

    async def _stay_connected(self) -> None:
        """Connect to the broker, again after every loss of the connection."""
        pause_s = RETRY_S[0]
        while True:
            before = self._connections
            try:
                await self._connected()
            # except*: the task group wraps what its tasks raise
            except* aiomqtt.MqttError as errors:
                self._note_loss(errors.exceptions[0])
            if self._connections > before:
                pause_s = RETRY_S[0]
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, RETRY_S[1])

    def _note_loss(self, error: BaseException) -> None:
        """Report once that there is no broker; the attempts go on silently."""
        if not self._alone:
            self._alone = True
            say(f"no broker at {self._broker} ({error}); trying again, newer values replace older ones")

    async def _connected(self) -> None:
        """One connection to the broker, until it is lost or the bridge is cancelled."""
        will = aiomqtt.Will(self._topics.status, OFFLINE, qos=1, retain=True)
        async with aiomqtt.Client(
            **self._broker.options(),
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
                    if self._commands is not None:
                        tasks.create_task(self._obey(client, self._commands), name="mqtt-obey")
            except asyncio.CancelledError:
                # a client that disconnects properly does not cause its last will: "offline" has to be published
                with contextlib.suppress(aiomqtt.MqttError):
                    await client.publish(self._topics.status, OFFLINE, qos=1, retain=True)
                raise

    async def _publish(self, client: aiomqtt.Client) -> None:
        """Publish new states for ever. A broker that does not accept them causes no queue here: newer ones replace them."""
        await client.publish(self._topics.status, ONLINE, qos=1, retain=True)
        statistics_due = 0.0
        while True:
            started, now_ns = time.monotonic(), time.monotonic_ns()
            rows = self._board.rows(now_ns)
            for publication in self._publisher.due(rows, now_ns + wallclock.SHARED.ahead_ns):
                # QoS 0: a lost state is replaced by the next one within `every_s`
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

    async def _obey(self, client: aiomqtt.Client, commands: Commands) -> None:
        """Commands to the gateway's control socket, one after the other, and its answers."""
        await client.subscribe(self._topics.command, qos=1)
        async for message in client.messages:
            if message.retain:  # the broker would deliver it again after every reconnection
                answer: dict[str, Any] = {"ok": False, "error": "a retained command is not obeyed"}
            else:
                answer = await asyncio.to_thread(commands.obey, message.payload)
            await client.publish(self._topics.reply, json.dumps(answer), qos=1)


def say(text: str) -> None:
    """One line for whoever started the bridge."""
    print(f"loaderhil: {text}", file=sys.stderr)
