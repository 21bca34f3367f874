"""The wire format between the hub and its clients: a stream of records of one size, one per frame.

    offset  size  field
         0    72  struct canfd_frame of Linux (include/uapi/linux/can.h), native byte order:
                  can_id, length, flags, kind, reserved, data[64]
        72     8  stamp: when the hub took the frame over, CLOCK_MONOTONIC [ns]; 0 on the way to the hub
        80     4  frames that the hub has dropped for this client so far, 0 if none or not reported here

`kind` (the kernel's reserved byte) is OWN on a frame that the hub returns to its sender, CONTROL
on the head of a control message: a JSON object, `can_id` bytes long, in the records that follow,
padded with zeros. The length in such a head is one that no frame has.
"""

import json
import struct
from typing import Any

from bus.bounded_json import read_object
from bus.frame import FD, Frame

LAYOUT = struct.Struct("=IBBBx64sqI")
TAIL = struct.Struct("=qI")  # stamp, dropped
DROPPED = struct.Struct("=I")
LENGTH_AT = 4
KIND_AT = 6
TAIL_AT = 72
# Fixed size: a reader finds every record by multiplication, and passes on many without looking inside.
SIZE = LAYOUT.size
OWN, CONTROL = 1, 2
PROTOCOL = 2

CLASSIC_LIMIT = 8
FD_LIMIT = 64
FD_LENGTHS = frozenset((*range(9), 12, 16, 20, 24, 32, 48, 64))
"""Data lengths that a CAN FD frame can have."""
CONTROL_LIMIT = 1 << 20
"""Longest control message that is read at all [bytes]; the status of a full hub takes some 20 000."""
# 255 is no length of CAN or CAN FD, so a control head cannot be taken for a frame.
_NO_LENGTH = 255
_HEAD = struct.Struct("=IBBB")


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
    """The record of a frame on its way to the hub; ValueError if no bus could carry it."""
    can_id, data, _, flags = frame
    length = len(data)
    if length > CLASSIC_LIMIT:
        check(frame)
    return LAYOUT.pack(can_id, length, flags, 0, data, 0, 0)


def carries(record: bytes | bytearray | memoryview, at: int = 0) -> bool:
    """Whether the length in the record at `at` is one that its kind of frame can have."""
    length = record[at + LENGTH_AT]
    return length <= CLASSIC_LIMIT or bool(record[at + 5] & FD and length in FD_LENGTHS)


def frames_until(records: bytearray, start: int, end: int) -> int:
    """Where the frames end that begin at `start`: at another kind of record, one that is not whole, or `end`."""
    at, last = start, end - SIZE
    while at <= last and (records[at + LENGTH_AT] <= CLASSIC_LIMIT or carries(records, at)):
        at += SIZE
    return at


def stamp(records: memoryview, stamp_ns: int) -> int:
    """Stamp the frames in `records`, a nanosecond apart, and clear `kind`; returns how many frames they are."""
    count = 0
    for at in range(0, len(records), SIZE):
        records[at + KIND_AT] = 0
        # set by the hub alone: a client cannot send a frame that looks like another's confirmation
        # one nanosecond apart: stamps strictly increase, so all clients sort the frames alike
        TAIL.pack_into(records, at + TAIL_AT, stamp_ns + count, 0)
        count += 1
    return count


def mark_own(records: memoryview) -> None:
    """Mark the frames in `records` as OWN: copies that return to their sender."""
    for at in range(KIND_AT, len(records), SIZE):
        records[at] = OWN


def control(message: dict[str, Any]) -> bytes:
    """A control message as records."""
    text = json.dumps(message).encode()
    # padded to whole records, so that the following record still begins at a multiple of SIZE
    head = LAYOUT.pack(len(text), _NO_LENGTH, 0, CONTROL, b"", 0, 0)
    return head + text.ljust(-(-len(text) // SIZE) * SIZE, b"\0")


def control_size(records: bytes | bytearray | memoryview, at: int = 0) -> int:
    """Bytes of the control message whose head is at `at`, head and padding included; 0 if none begins there."""
    size, length, _, kind = _HEAD.unpack_from(records, at)
    if length != _NO_LENGTH or kind != CONTROL:
        return 0
    return SIZE + int(-(-size // SIZE)) * SIZE


def read_control(records: bytes | memoryview) -> dict[str, Any]:
    """The control message in `records`; ValueError if it is none."""
    if len(records) < SIZE or control_size(records) != len(records):
        raise ValueError(f"{len(records)} bytes that are no control message")
    return read_object(bytes(records[SIZE:]).rstrip(b"\0"), CONTROL_LIMIT)
