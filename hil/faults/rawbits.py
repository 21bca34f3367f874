"""Reads and writes the raw bits of one signal inside a frame, for faults that must not round a value."""

from typing import Literal

from dbc.database import MessageCodec
from dbc.signal import Signal


class RawSignal:
    """One signal of a message, as the unsigned integer that its bits are."""

    def __init__(self, codec: MessageCodec, name: str) -> None:
        self.signal: Signal = codec.by_signal[name]
        self._order: Literal["big", "little"] = "big" if self.signal.big_endian else "little"
        self._length = codec.length
        self._shift = self.signal.shift(8 * codec.length)
        self._mask = (1 << self.signal.length) - 1

    def read(self, data: bytes) -> int:
        """The bits."""
        return self._whole(data) >> self._shift & self._mask

    def write(self, data: bytes, raw: int) -> bytes:
        """The frame with these bits instead; bits beyond the signal's length are cut off."""
        whole = self._whole(data) & ~(self._mask << self._shift) | (raw & self._mask) << self._shift
        return whole.to_bytes(self._length, self._order)

    def to_number(self, raw: int) -> int:
        """The raw integer that the bits stand for: two's complement where the signal is signed."""
        return raw - (1 << self.signal.length) if self.signal.signed and raw > self._mask >> 1 else raw

    def _whole(self, data: bytes) -> int:
        return int.from_bytes(data, self._order)


def signed_again(codec: MessageCodec, data: bytes) -> bytes:
    """The frame with a CRC that fits its content, where its message has one; the counter stays."""
    if codec.protection is None:
        return data
    return codec.protection.protect(data, codec.protection.counter(data))
