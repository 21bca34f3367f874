"""What travels between the hub and its clients, one packet per frame.

    offset  size  field
         0    72  struct canfd_frame of Linux (include/uapi/linux/can.h), native byte order:
                  can_id, length, flags, own, reserved, data[64]
        72     8  stamp: when the hub took the frame over, CLOCK_MONOTONIC [ns]; 0 on the way to the hub
        80     4  frames that the hub has dropped for this client so far; 0 on the way to the hub

`own` (the kernel's reserved byte) is 1 on a frame that the hub returns to its sender. A
packet of any other size is a control message: a JSON object, padded by a space if it
would have the size of a frame.
"""

import json
import struct
from typing import Any

from bus.frame import FD, Frame

LAYOUT = struct.Struct("=IBBBx64sqI")
TAIL = struct.Struct("=qI")  # stamp, dropped
TAIL_AT = 72
LENGTH_AT = 4
OWN_AT = 6
SIZE = LAYOUT.size
CONTROL_LIMIT = 65536
"""Longest control message [bytes]."""
PROTOCOL = 1

CLASSIC_LIMIT = 8
FD_LIMIT = 64
FD_LENGTHS = frozenset((*range(9), 12, 16, 20, 24, 32, 48, 64))
"""Data lengths that a CAN FD frame can have."""


def check(frame: Frame) -> None:
    """ValueError if no bus could carry the frame."""
    length = len(frame.data)
    if length <= CLASSIC_LIMIT or (frame.flags & FD and length in FD_LENGTHS):
        return
    if frame.flags & FD:
        rule = f"CAN FD carries {', '.join(map(str, sorted(FD_LENGTHS)))}; pad the data"
    else:
        rule = "a classic frame carries 0 to 8; is the FD flag missing?"
    raise ValueError(f"frame {frame.identifier:X}: {length} data bytes; {rule}")


def pack(frame: Frame) -> bytes:
    """The packet of a frame on its way to the hub; ValueError if no bus could carry it."""
    check(frame)
    return LAYOUT.pack(frame.can_id, len(frame.data), frame.flags, 0, frame.data, 0, 0)


def well_formed(packet: bytes | bytearray | memoryview) -> bool:
    """Whether the length in a frame's packet is one that its kind of frame can have."""
    length = packet[LENGTH_AT]
    return length <= CLASSIC_LIMIT or bool(packet[5] & FD and length in FD_LENGTHS)


def control(message: dict[str, Any]) -> bytes:
    """A control message as a packet that cannot be taken for a frame."""
    text = json.dumps(message).encode()
    return text + b" " if len(text) == SIZE else text


def read_control(packet: bytes | memoryview) -> dict[str, Any]:
    """A control message; ValueError if it is none."""
    message = json.loads(bytes(packet))
    if not isinstance(message, dict):
        raise ValueError(f"a control message is a JSON object, not {type(message).__name__}")
    return message
