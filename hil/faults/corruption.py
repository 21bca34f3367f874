"""Faults that flip bits: like a disturbed line, or like a defective sender, whose CRC is valid."""

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


@dataclass(frozen=True, slots=True)
class Corrupt:
    """Random bits of a frame are flipped, with a probability."""

    probability: float  # for each frame, 0 to 1
    bits: int  # number of different bits
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
        data = bytearray(frame.data)
        for bit in self._generator.sample(room, min(settings.bits, len(room))):
            data[bit // 8] ^= 1 << bit % 8
        signed = signed_again(codec, bytes(data)) if codec and settings.valid_crc else bytes(data)
        return (Planned(at_ns, frame._replace(data=signed)),)


def read_corrupt(table: CheckedTable) -> Corrupt:
    """kind = "corrupt"."""
    return Corrupt(
        probability=read_probability(table),
        bits=table.integer("bits", low=1, high=512, default=1),
        valid_crc=table.flag("valid_crc", default=False),
    )
