"""Decodes the error frames of Linux (what a CAN controller reports) to findings in plain text.

Layout and constants: include/uapi/linux/can/error.h. The class is a bit mask in the
identifier; up to eight data bytes hold the details.
"""

from dataclasses import dataclass
from enum import StrEnum

from bus.frame import ERROR, Frame

FINDINGS_LIMIT = 1024
"""Findings that a transport keeps until they are asked for; the oldest go first."""


class Fault(StrEnum):
    """Kinds of trouble on a bus."""

    TX_TIMEOUT = "transmission timed out"
    LOST_ARBITRATION = "arbitration lost"
    RX_OVERFLOW = "controller's receive buffer overflowed"
    TX_OVERFLOW = "controller's transmit buffer overflowed"
    WARNING = "error warning level reached"
    PASSIVE = "controller is error passive"
    ACTIVE = "controller is error active again"
    CONTROLLER = "controller problem"
    PROTOCOL = "protocol violation"
    TRANSCEIVER = "transceiver problem"
    NO_ACK = "no acknowledgement"
    BUS_OFF = "bus off"
    BUS_ERROR = "bus error"
    RESTARTED = "controller restarted"
    COUNTERS = "error counters"
    SEND_QUEUE = "transmit queue is full"
    LINK_DOWN = "interface went down"
    LINK_UP = "interface is up again"
    LINK_GONE = "interface was removed"


@dataclass(frozen=True, slots=True)
class BusFinding:
    """Trouble on a bus, or its end."""

    fault: Fault
    at_ns: int  # CLOCK_MONOTONIC [ns]
    detail: str = ""  # what is known beyond the kind, such as the place in the frame

    def __str__(self) -> str:
        return f"{self.fault} ({self.detail})" if self.detail else str(self.fault)


_CONTROLLER = (  # data[1]
    (0x01, Fault.RX_OVERFLOW, ""),
    (0x02, Fault.TX_OVERFLOW, ""),
    (0x04, Fault.WARNING, "receive errors"),
    (0x08, Fault.WARNING, "transmit errors"),
    (0x10, Fault.PASSIVE, "receive errors"),
    (0x20, Fault.PASSIVE, "transmit errors"),
    (0x40, Fault.ACTIVE, ""),
)
_PROTOCOL = (  # data[2]
    (0x01, "single bit"),
    (0x02, "frame format"),
    (0x04, "bit stuffing"),
    (0x08, "dominant bit could not be sent"),
    (0x10, "recessive bit could not be sent"),
    (0x20, "overload"),
    (0x40, "active error announcement"),
    (0x80, "while transmitting"),
)
_LOCATION = {  # data[3]
    0x02: "identifier bits 28 to 21",
    0x03: "start of frame",
    0x04: "substitute remote request",
    0x05: "identifier extension",
    0x06: "identifier bits 20 to 18",
    0x07: "identifier bits 17 to 13",
    0x08: "CRC sequence",
    0x09: "reserved bit 0",
    0x0A: "data",
    0x0B: "data length code",
    0x0C: "remote request",
    0x0D: "reserved bit 1",
    0x0E: "identifier bits 4 to 0",
    0x0F: "identifier bits 12 to 5",
    0x12: "intermission",
    0x18: "CRC delimiter",
    0x19: "acknowledge slot",
    0x1A: "end of frame",
    0x1B: "acknowledge delimiter",
}
_TRANSCEIVER = {  # data[4]
    0x04: "CAN high: no wire",
    0x05: "CAN high: short to battery",
    0x06: "CAN high: short to supply",
    0x07: "CAN high: short to ground",
    0x40: "CAN low: no wire",
    0x50: "CAN low: short to battery",
    0x60: "CAN low: short to supply",
    0x70: "CAN low: short to ground",
    0x80: "CAN low: short to CAN high",
}
_PLAIN = (  # classes that need no data, in the order in which they are reported
    (0x001, Fault.TX_TIMEOUT),
    (0x020, Fault.NO_ACK),
    (0x040, Fault.BUS_OFF),
    (0x080, Fault.BUS_ERROR),
    (0x100, Fault.RESTARTED),
)
_LOST_ARBITRATION, _CONTROLLER_CLASS, _PROTOCOL_CLASS, _TRANSCEIVER_CLASS, _COUNTERS = (
    0x2,
    0x4,
    0x8,
    0x10,
    0x200,
)


def findings(frame: Frame) -> list[BusFinding]:
    """Everything that an error frame says; [] for any other frame."""
    if not frame.can_id & ERROR:
        return []
    data = frame.data.ljust(8, b"\0")
    found: list[tuple[Fault, str]] = [(fault, "") for bit, fault in _PLAIN if frame.can_id & bit]
    if frame.can_id & _LOST_ARBITRATION:
        found.append((Fault.LOST_ARBITRATION, f"in bit {data[0]}" if data[0] else ""))
    if frame.can_id & _CONTROLLER_CLASS:
        said = [(fault, detail) for bit, fault, detail in _CONTROLLER if data[1] & bit]
        found += said or [(Fault.CONTROLLER, "unspecified")]
    if frame.can_id & _PROTOCOL_CLASS:
        found.append((Fault.PROTOCOL, _violation(data[2], data[3])))
    if frame.can_id & _TRANSCEIVER_CLASS:
        found.append((Fault.TRANSCEIVER, _TRANSCEIVER.get(data[4], f"code 0x{data[4]:02X}")))
    if frame.can_id & _COUNTERS:
        found.append((Fault.COUNTERS, f"transmit {data[6]}, receive {data[7]}"))
    return [BusFinding(fault, frame.at_ns, detail) for fault, detail in found]


def _violation(kinds: int, location: int) -> str:
    """What was violated, and where in the frame."""
    what = ", ".join(text for bit, text in _PROTOCOL if kinds & bit) or "unspecified"
    where = _LOCATION.get(location, f"location 0x{location:02X}") if location else ""
    return f"{what}; in {where}" if where else what
