"""A ring of frames in shared memory between the two processes of the recorder; neither side ever waits for the other.

    offset  size  field
         0     8  head: frames put so far, written by the putting side only
        64     8  tail: frames taken so far, written by the taking side only (a cache line of its own)
       128     8  dropped: frames that found the ring full
       192  80 n  records, the k-th frame in slot k modulo n

A record is written before the head that announces it. x86-64 keeps stores in order; on other processors the
system calls with which either side waits between its turns act as barriers.
"""

import mmap
import os
import struct
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame

RECORD = np.dtype(
    [
        ("at_ns", "<i8"),
        ("can_id", "<u4"),
        ("length", "u1"),
        ("flags", "u1"),
        ("channel", "u1"),
        ("spare", "u1"),
        ("data", "u1", 64),
    ]
)
"""One frame as `bus.frame.Frame` has it, and the number of the bus it came from."""
Records = NDArray[np.void]
SLOTS = 1 << 18
"""Frames that can wait to be written: 6.5 s of ten full buses (40 000 frames/s), 21 MB."""
CHANNELS = 256
_LAYOUT = struct.Struct("<qIBBBx64s")
_HEAD, _TAIL, _DROPPED = 0, 8, 16  # words of 8 bytes
_RECORDS = 192  # bytes


class Ring:
    """One side of the ring; `create` makes it, `attach` opens it from the descriptor in another process."""

    def __init__(self, descriptor: int, slots: int) -> None:
        self._descriptor = descriptor
        self._slots = slots
        # MAP_POPULATE: all pages now, so that no frame waits for a page fault and the process' memory does not grow.
        size = _RECORDS + slots * RECORD.itemsize
        self._map = mmap.mmap(descriptor, size, flags=mmap.MAP_SHARED | mmap.MAP_POPULATE)
        # A word of a view is written in one step. struct.pack_into clears its place first, so that the other side could read 0.
        self._words = memoryview(self._map)[:_RECORDS].cast("Q")
        # own copies of the words that only this side writes; the other side's word is read each time
        self._head = self._words[_HEAD]
        self._tail = self._words[_TAIL]
        self._dropped = self._words[_DROPPED]

    @classmethod
    def create(cls, slots: int = SLOTS) -> Self:
        """An empty ring in memory that has no name and goes with its last user."""
        if slots < 1:
            raise ValueError(f"slots={slots}: a ring needs at least one")
        descriptor = os.memfd_create("loaderhil-recording", os.MFD_CLOEXEC)
        os.ftruncate(descriptor, _RECORDS + slots * RECORD.itemsize)
        return cls(descriptor, slots)

    @classmethod
    def attach(cls, descriptor: int) -> Self:
        """The ring behind a descriptor passed on by its maker."""
        return cls(descriptor, (os.fstat(descriptor).st_size - _RECORDS) // RECORD.itemsize)

    def fileno(self) -> int:
        """The descriptor to pass on."""
        return self._descriptor

    @property
    def put_count(self) -> int:
        """Frames put so far, dropped ones not included."""
        return self._words[_HEAD]

    @property
    def dropped(self) -> int:
        """Frames that found the ring full."""
        return self._words[_DROPPED]

    def put(self, frames: Sequence[Frame], channel: int) -> None:
        """Append frames; those that find no room are dropped and counted."""
        # the tail may grow meanwhile: the room is then larger than computed, never smaller
        room = self._slots - (self._head - self._words[_TAIL])
        if len(frames) > room:
            self._dropped += len(frames) - room
            self._words[_DROPPED] = self._dropped
            frames = frames[:room]
        head, slots, size, target, pack = (
            self._head,
            self._slots,
            RECORD.itemsize,
            self._map,
            _LAYOUT.pack_into,
        )
        for can_id, data, at_ns, flags in frames:
            # written in place: no intermediate object per frame
            pack(target, _RECORDS + head % slots * size, at_ns, can_id, len(data), flags, channel, data)
            head += 1
        self._head = head
        self._words[_HEAD] = head

    @property
    def taken_count(self) -> int:
        """Frames released so far by the taking side."""
        return self._words[_TAIL]

    def take(self, limit: int) -> Records:
        """At most `limit` of the oldest frames, as a copy; they make room."""
        taken = self.peek(limit)
        self.release(len(taken))
        return taken

    def peek(self, limit: int) -> Records:
        """At most `limit` of the oldest frames, as a copy; they stay until they are released."""
        waiting = min(self._words[_HEAD] - self._tail, limit)
        start = self._tail % self._slots
        first = self._records(start, min(waiting, self._slots - start))
        rest = self._records(0, waiting - len(first))
        return np.concatenate((first, rest))

    def release(self, count: int) -> None:
        """Free the slots of the `count` oldest frames, after they have been written to the file."""
        self._tail += count
        self._words[_TAIL] = self._tail

    def _records(self, start: int, count: int) -> Records:
        at = _RECORDS + start * RECORD.itemsize
        return np.frombuffer(self._map[at : at + count * RECORD.itemsize], RECORD)

    def close(self) -> None:
        """Release the memory; a second call does nothing."""
        if self._descriptor >= 0:
            self._words.release()
            self._map.close()
            os.close(self._descriptor)
            self._descriptor = -1


def records_of(frames: Sequence[Frame], channel: int = 0) -> Records:
    """Frames as records, without a ring."""
    packed = (
        _LAYOUT.pack(at_ns, can_id, len(data), flags, channel, data) for can_id, data, at_ns, flags in frames
    )
    return np.frombuffer(b"".join(packed), RECORD)


def frames_of(records: Records) -> list[tuple[int, Frame]]:
    """(channel, frame) of each record."""
    unpacked: list[tuple[Any, ...]] = list(_LAYOUT.iter_unpack(records.tobytes()))
    return [
        (channel, Frame(can_id, data[:length], at_ns, flags))
        for at_ns, can_id, length, flags, channel, data in unpacked
    ]
