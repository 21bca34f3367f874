"""pyxcp on the ECU's XCP service, in one process and without a clock: what the tool sends is answered at once."""

import contextlib
import logging
import queue
import threading
from collections.abc import Iterator, Sequence

import can
from pyxcp.config import create_application_from_config
from pyxcp.master import Master
from pyxcp.transport.base import NoOpPolicy

from bus.frame import EXTENDED, EXTENDED_MASK, Frame
from bus.python_can import from_message, to_message
from dbc import loader_database
from ecu.calibration import calibration_table, read_calibration
from ecu.cycle import EcuCycle
from ecu.measure.access import CALIBRATE, key_of
from ecu.measure.channel import EXAMPLE, Channel
from ecu.xcp.service import xcp_service
from tests.ecu.machine import FakeMachine

SECRET = b"a secret for the tests only"
CHANNEL = Channel.parse(EXAMPLE, loader_database())


class Ecu:
    """An ECU with XCP and a machine; `cycles` lets the time go on."""

    channel = CHANNEL

    def __init__(self, *, secret: bytes | None = SECRET, **options: bool) -> None:
        table = calibration_table()
        self.cycle = EcuCycle(read_calibration(table), **options)
        self.machine = FakeMachine()
        seeds = iter(range(1, 1 << 16))
        self.service = xcp_service(
            self.cycle, table, CHANNEL, secret=secret, random=lambda n: next(seeds).to_bytes(n, "big")
        )
        self.sent: list[Frame] = []  # by the service after cycles
        self.now_ns = 0
        self.lock = threading.RLock()  # pyxcp's listener is a thread of its own

    def cycles(self, count: int) -> list[Frame]:
        """So many cycles; the frames that the service sends after them."""
        sent: list[Frame] = []
        with self.lock:
            for _ in range(count):
                for frame in self.machine.frames():
                    self.cycle.receive(frame, frame.at_ns)
                self.now_ns = self.machine.now_ns
                self.service.before_cycle(self.now_ns)
                self.cycle.tick(self.now_ns)
                sent += self.service.after_cycle(self.now_ns)
        return sent

    def answers(self, packet: bytes | str) -> list[bytes]:
        """What the service answers to one command."""
        data = bytes.fromhex(packet) if isinstance(packet, str) else packet
        with self.lock:
            return [f.data for f in self.service.receive(Frame(self.channel.receive, data), self.now_ns)]

    def ask(self, packet: bytes | str) -> bytes:
        """The one answer to a command."""
        (answer,) = self.answers(packet)
        return answer

    def unlock(self) -> None:
        """Give seed and key in their packets."""
        seed = b""
        for mode in (0, 1):
            seed += self.ask(bytes((0xF8, mode, 1)))[2:]
        key = key_of(SECRET, CALIBRATE, seed)
        for at in range(0, len(key), 6):
            self.ask(bytes((0xF7, len(key) - at)) + key[at : at + 6])


class DirectBus(can.BusABC):
    """The bus between tool and ECU; nobody else is on it."""

    def __init__(self, ecu: Ecu) -> None:
        self._ecu, self._waiting = ecu, queue.Queue[can.Message]()
        super().__init__(channel="direct")
        self.channel_info = "direct"

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        with self._ecu.lock:
            self.deliver(self._ecu.service.receive(from_message(msg), self._ecu.now_ns))

    def deliver(self, frames: Sequence[Frame]) -> None:
        for frame in frames:
            self._waiting.put(to_message(frame, 0, "direct"))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            return self._waiting.get(timeout=timeout), True
        except queue.Empty:
            return None, True


def application(secret: bytes = SECRET, **can_options: object):
    """pyxcp's configuration for the channel."""

    def identifier(word: int) -> int:
        return word & EXTENDED_MASK | (EXTENDED if word & EXTENDED else 0)

    return create_application_from_config(
        {
            "Transport": {
                "CAN": {
                    "can_id_master": identifier(CHANNEL.receive),
                    "can_id_slave": identifier(CHANNEL.send),
                    **can_options,
                }
            },
            "General": {
                "disable_error_handling": True,
                "seed_n_key_function": lambda _, seed: key_of(secret, CALIBRATE, seed),
            },
        },
        log_level=logging.CRITICAL,
    )


@contextlib.contextmanager
def tool(
    bus: can.BusABC | None, secret: bytes = SECRET, policy=None, **can_options: object
) -> Iterator[Master]:
    """A pyxcp master that is connected."""
    master = Master(
        "can",
        config=application(secret, **can_options),
        policy=policy or NoOpPolicy(),
        transport_layer_interface=bus,
    )
    with master:
        master.connect()
        yield master
