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
# Our own mark in a bit that the kernel's flags leave free: the frame was sent from this machine. Set only by a
# transport that was opened with `origins`.
LOCAL = 0x80


class Frame(NamedTuple):
    """A frame on the bus."""

    # A NamedTuple, not a dataclass: cheap to make, and unpacked in one statement in the inner loops.
    can_id: int  # Linux `can_id` word, flags included
    data: bytes  # 0 to 8 bytes, or up to 64 for CAN FD
    at_ns: int = 0  # when the transport saw it, CLOCK_MONOTONIC [ns]; 0 if not yet sent
    flags: int = 0  # CAN FD flags (FD, BRS, ESI); 0 for a classic frame

    @property
    def extended(self) -> bool:
        """Whether the identifier has 29 bits."""
        return bool(self.can_id & EXTENDED)

    @property
    def identifier(self) -> int:
        """The identifier without its flags."""
        return self.can_id & (EXTENDED_MASK if self.can_id & EXTENDED else STANDARD_MASK)
