"""Faults that flip bits or replace the payload: like a disturbed line, or like a defective sender, whose CRC is valid."""

import random
from collections.abc import Sequence
from dataclasses import dataclass

from configuration import CheckedTable
from dbc.database import MessageCodec
from hil.faults.loss import read_probability
from hil.faults.passage import Effect, Planned, Side
from hil.faults.rawbits import signed_again

PROTECTION_BITS = 12
"""AUTOSAR E2E profile 1: CRC in byte 0, counter in the low nibble of byte 1."""
FLIPPED = "bits"
REPLACED = ("random", "zeros", "ones")
CONTENTS = (FLIPPED, *REPLACED, "any")
"""What becomes of a payload: some of its bits are flipped, or all of it is replaced; `any`: by one of the three, drawn for each frame."""


@dataclass(frozen=True, slots=True)
class Corrupt:
    """Random bits of a frame are flipped, or its payload is replaced, with a probability."""

    probability: float  # for each frame, 0 to 1
    content: str  # one of CONTENTS
    bits: int  # number of different bits to flip
    # CRC and counter are not flipped, and the CRC is computed anew: only a plausibility check can detect the
    # fault. Messages without protection have no CRC; for them the setting makes no difference.
    valid_crc: bool

    def effect(self, generator: random.Random) -> Effect:
        return _Corrupting(self, generator)


class _Corrupting(Effect):
    def __init__(self, settings: Corrupt, generator: random.Random) -> None:
        self._settings, self._generator = settings, generator

    def passed(self, planned: Planned, side: Side, codec: MessageCodec | None) -> Sequence[Planned]:
        settings, at_ns, frame = self._settings, *planned
        if self._generator.random() >= settings.probability or not frame.data:
            return (planned,)
        protected = codec is not None and codec.protection is not None
        first = PROTECTION_BITS if settings.valid_crc and protected else 0
        room = range(first, 8 * len(frame.data))
        data = int.from_bytes(frame.data, "little") ^ self._change(room, frame.data)
        changed = data.to_bytes(len(frame.data), "little")
        signed = signed_again(codec, changed) if codec and settings.valid_crc else changed
        return (Planned(at_ns, frame._replace(data=signed)),)

    def _change(self, room: range, data: bytes) -> int:
        """The bits to invert, as a little-endian number; room: the bits that may be changed."""
        settings = self._settings
        if settings.content == FLIPPED:
            return sum(1 << bit for bit in self._generator.sample(room, min(settings.bits, len(room))))
        mask = (1 << room.stop) - (1 << room.start)
        content = self._generator.choice(REPLACED) if settings.content == "any" else settings.content
        drawn = self._generator.getrandbits(room.stop) if content == "random" else 0
        wanted = {"zeros": 0, "ones": mask, "random": drawn}[content]
        return (int.from_bytes(data, "little") ^ wanted) & mask


def read_corrupt(table: CheckedTable) -> Corrupt:
    """kind = "corrupt"."""
    content = table.choice("content", CONTENTS) if "content" in table.keys() else FLIPPED  # noqa: SIM118
    return Corrupt(
        probability=read_probability(table),
        content=content,
        # only asked for where it acts: a number of bits beside a whole payload is a mistake
        bits=table.integer("bits", low=1, high=512, default=1) if content == FLIPPED else 0,
        valid_crc=table.flag("valid_crc", default=False),
    )
