"""XCP on CAN as a service of the ECU: frames in, frames out."""

from collections.abc import Callable
from typing import Final

from bus.frame import Frame
from configuration import CheckedTable
from ecu.cycle import EcuCycle
from ecu.measure.access import CALIBRATE, Lock
from ecu.measure.channel import Channel
from ecu.measure.measurements import MeasuredImage
from ecu.measure.pages import CalibrationPages
from ecu.xcp.memory import Memory, epk
from ecu.xcp.slave import XcpSlave

ASCII_TEXT, A2L_NAME, A2L_FILE, EPK = 0, 1, 2, 5
"""Types of GET_ID."""
EXTENSION: Final = ".a2l"


def a2l_name(calibration: str) -> str:
    """Name of the A2L file for a calibration, without extension."""
    return f"loaderhil_{calibration}"


def identifications(calibration: str) -> dict[int, bytes]:
    """Answers to GET_ID by type."""
    name = a2l_name(calibration)
    return {
        ASCII_TEXT: f"loaderhil {calibration}".encode(),
        A2L_NAME: name.encode(),
        A2L_FILE: (name + EXTENSION).encode(),
        EPK: epk(),
    }


class XcpService:
    """One slave on one channel."""

    def __init__(self, slave: XcpSlave, channel: Channel) -> None:
        self._slave, self._channel = slave, channel
        self._events: list[bytes] = []

    def receive(self, frame: Frame, now_ns: int) -> list[Frame]:
        """The answers to a command; none to other frames."""
        packet = self._channel.data_of(frame)
        return [] if packet is None else self._framed(self._slave.command(packet, now_ns))

    def before_cycle(self, now_ns: int) -> None:
        """Take over what was written since the last cycle."""
        self._events += self._slave.before_cycle(now_ns)

    def after_cycle(self, now_ns: int) -> list[Frame]:
        """Events, and what was measured in the cycle."""
        packets, self._events = self._events + self._slave.after_cycle(now_ns), []
        return self._framed(packets)

    def may_send(self) -> bool:
        """It keeps nobody from sending."""
        return True

    def _framed(self, packets: list[bytes]) -> list[Frame]:
        return [Frame(self._channel.send, packet) for packet in packets]


def xcp_service(
    cycle: EcuCycle,
    table: CheckedTable,
    channel: Channel,
    *,
    secret: bytes | None,
    random: Callable[[int], bytes],
) -> XcpService:
    """XCP for an ECU. table: that of its calibration; secret: without one the calibration can only be read."""
    memory = Memory(CalibrationPages(cycle, table), MeasuredImage(cycle))
    texts = identifications(cycle.calibration.name)
    return XcpService(XcpSlave(memory, Lock(secret, CALIBRATE, random), texts), channel)
