"""How much of a classic CAN bus the cyclic messages of a DBC take.

Frame lengths by ISO 11898-1: a data frame with an n-byte payload has 34 (11-bit identifier) or 54
(29-bit) bits subject to stuffing plus 8 n, and 13 bits that are not; in the worst case a stuff bit
follows every fourth of the stuffed bits after the first (Davis et al., Real-Time Systems 35, 2007, eq. 1).
"""

from collections.abc import Iterable
from dataclasses import dataclass

from bus.frame import EXTENDED
from dbc.database import MessageCodec

STUFFED_STANDARD, STUFFED_EXTENDED, UNSTUFFED = 34, 54, 13


@dataclass(frozen=True, slots=True)
class BusLoad:
    """Load of a bus."""

    least: float  # share of the bus, 0 to 1, without any stuff bit
    most: float  # share of the bus with as many stuff bits as there can be
    frames_per_s: float  # [1/s]


def frame_bits(length: int, *, extended: bool) -> tuple[int, int]:
    """Least and most bits on the wire of a classic frame with `length` bytes (0..8), interframe space included."""
    if not 0 <= length <= 8:
        raise ValueError(f"a classic CAN frame has 0 to 8 bytes of data, not {length}")
    stuffed = (STUFFED_EXTENDED if extended else STUFFED_STANDARD) + 8 * length
    return stuffed + UNSTUFFED, stuffed + UNSTUFFED + (stuffed - 1) // 4


def bus_load(codecs: Iterable[MessageCodec], bit_rate: int) -> BusLoad:
    """Load of the cyclic messages at `bit_rate` [bit/s]; messages without a cycle time are left out."""
    least = most = frames = 0.0
    for codec in codecs:
        if codec.cycle_ns:
            per_second = 1e9 / codec.cycle_ns
            low, high = frame_bits(codec.length, extended=bool(codec.can_id & EXTENDED))
            least += low * per_second
            most += high * per_second
            frames += per_second
    return BusLoad(least / bit_rate, most / bit_rate, frames)
