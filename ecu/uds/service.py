"""UDS on ISO-TP as a service of the ECU: frames in, frames out. can-isotp cuts and joins the messages."""

import logging
from collections import deque
from collections.abc import Callable
from typing import Final

import isotp

from bus.frame import EXTENDED, EXTENDED_MASK, Frame
from configuration import CheckedTable
from ecu.cycle import EcuCycle
from ecu.measure.access import DIAGNOSE, Lock
from ecu.measure.channel import Channel
from ecu.uds.identity import identifiers, self_test
from ecu.uds.server import UdsServer

LOGGER: Final = "ecu.uds.isotp"
LONGEST_REQUEST: Final = 255
"""No request of the served services is longer; a first frame that announces more is answered by an overflow."""
SINGLE_BYTES, LONGEST_ANNOUNCED = 7, 4095
"""Most bytes of a message in one frame, and of one whose length has twelve bits."""
_SINGLE, _FIRST, _CONSECUTIVE, _FLOW_CONTROL = range(4)
_OVERFLOW: Final = 2
"""The last status of a flow control."""


class UdsService:
    """One server on one channel."""

    def __init__(self, server: UdsServer, channel: Channel) -> None:
        self._server, self._channel = server, channel
        self._heard: deque[isotp.CanMessage] = deque()
        self._sent: list[Frame] = []
        mode = (
            isotp.AddressingMode.Normal_29bits
            if channel.send & EXTENDED
            else isotp.AddressingMode.Normal_11bits
        )
        address = isotp.Address(mode, rxid=channel.receive & EXTENDED_MASK, txid=channel.send & EXTENDED_MASK)
        self._link = isotp.TransportLayerLogic(
            rxfn=lambda _: self._heard.popleft() if self._heard else None,
            txfn=self._send,
            address=address,
            error_handler=lambda _: None,  # a broken transfer is the tool's to begin anew
            params={
                "max_frame_size": LONGEST_REQUEST,
                "blocksize": 0,
                "tx_padding": 0xCC,
                "logger_name": LOGGER,
            },
        )
        # a line per broken frame: whoever sends noise would fill the log and take the cycle's time
        logging.getLogger(LOGGER).setLevel(logging.CRITICAL)

    def receive(self, frame: Frame, now_ns: int) -> list[Frame]:
        """The frames with which a frame of the tool is answered."""
        data = self._channel.data_of(frame)
        if data is None:
            return []
        if (data := sound(data)) is None:
            return []
        extended = bool(frame.can_id & EXTENDED)
        self._heard.append(
            isotp.CanMessage(arbitration_id=frame.identifier, dlc=len(data), data=data, extended_id=extended)
        )
        return self._process(now_ns)

    def before_cycle(self, now_ns: int) -> None:
        """Let a restart take place, and a silent tool lose its session."""
        self._server.before_cycle(now_ns)

    def after_cycle(self, now_ns: int) -> list[Frame]:
        """The frames of a long answer for which the tool wanted a pause."""
        return self._process(now_ns)

    def may_send(self) -> bool:
        """It keeps nobody from sending."""
        return True

    def _process(self, now_ns: int) -> list[Frame]:
        self._link.process()
        while (request := self._link.recv()) is not None:
            if self._link.transmitting():
                continue  # half duplex: answers that wait for one another would have no bound
            answer = self._server.request(bytes(request), now_ns)
            if answer:
                self._link.send(answer)
                self._link.process()
        sent, self._sent = self._sent, []
        return sent

    def _send(self, message: isotp.CanMessage) -> None:
        self._sent.append(Frame(self._channel.send, bytes(message.data)))


def sound(data: bytes) -> bytes | None:
    """A frame as can-isotp understands what the standard says of it; None for one that has to be ignored.

    can-isotp ends a transfer for such a frame, or begins one. A pause with a reserved code is the longest one.
    """
    kind, low = data[0] >> 4, data[0] & 0x0F
    if kind == _SINGLE:
        return data if 0 < low < len(data) else None
    if kind == _FIRST:
        if len(data) < 8:
            return None
        announced = low << 8 | data[1]
        if announced == 0:  # the length has 32 bits, for what 12 cannot say
            return data if int.from_bytes(data[2:6], "big") > LONGEST_ANNOUNCED else None
        return data if announced > SINGLE_BYTES else None
    if kind == _CONSECUTIVE:
        return data
    if kind != _FLOW_CONTROL or len(data) < 3 or low > _OVERFLOW:
        return None
    return data if data[2] <= 0x7F or 0xF1 <= data[2] <= 0xF9 else bytes((*data[:2], 0x7F, *data[3:]))


def uds_service(
    cycle: EcuCycle,
    table: CheckedTable,
    channel: Channel,
    *,
    version: str,
    secret: bytes | None,
    random: Callable[[int], bytes],
) -> UdsService:
    """UDS for an ECU. table: that of its calibration; version: of the software; secret: without one nothing can be unlocked."""
    data = identifiers(cycle, table.values, version)
    return UdsService(UdsServer(cycle, Lock(secret, DIAGNOSE, random), data, self_test(cycle)), channel)
