"""One CAN or CAN FD frame as every part of loaderhil sees it.

The identifier is Linux' `can_id` word (include/uapi/linux/can.h): bits 0-28 the
identifier, bit 31 extended, bit 30 remote, bit 29 error. One integer is the key of
every table, and SocketCAN, the hub and the recorder write it unchanged.
"""

from typing import NamedTuple

EXTENDED = 0x8000_0000
REMOTE = 0x4000_0000
ERROR = 0x2000_0000
EXTENDED_MASK = 0x1FFF_FFFF
STANDARD_MASK = 0x7FF

FD = 0x04  # CANFD_FDF: the frame is CAN FD
BRS = 0x01  # CANFD_BRS: bit rate switched
ESI = 0x02  # CANFD_ESI: the sender is error passive
LOCAL = (
    0x80  # ours, not the kernel's: sent from this machine; only from a transport that was asked to mark them
)


class Frame(NamedTuple):
    """A frame on the bus.

    can_id: Linux `can_id` word, flags included.
    data: 0..8 bytes, or 0..64 for CAN FD.
    at_ns: when the transport saw it, integer nanoseconds of a monotonic clock; 0 if not yet sent.
    flags: CAN FD flags (FD, BRS, ESI), 0 for a classic frame.
    """

    can_id: int
    data: bytes
    at_ns: int = 0
    flags: int = 0

    @property
    def extended(self) -> bool:
        """Whether the identifier has 29 bits."""
        return bool(self.can_id & EXTENDED)

    @property
    def identifier(self) -> int:
        """The identifier without its flags."""
        return self.can_id & (EXTENDED_MASK if self.can_id & EXTENDED else STANDARD_MASK)
