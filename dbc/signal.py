"""One signal of a DBC message: the place of its bits and their meaning.

physical = raw * scale + offset, with raw unsigned, two's complement or an IEEE 754 float.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

_FLOAT_BITS = (16, 32, 64)
_NOT_AVAILABLE = "not_available"


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """A signal as the DBC defines it."""

    name: str
    start: int  # DBC start bit: of the least significant bit (Intel) or the most significant one (Motorola)
    length: int  # bits
    big_endian: bool = False
    signed: bool = False
    is_float: bool = False
    scale: int | float = 1  # int, as the offset, where both are whole: this keeps integer signals integers
    offset: int | float = 0  # physical value of raw 0
    minimum: int | float | None = None  # of the physical range; None where the DBC gives none
    maximum: int | float | None = None
    start_value: int | float | None = None  # raw value sent before there is any other (GenSigStartValue)
    unit: str = ""  # of the physical value, as the DBC writes it
    comment: str = ""
    receivers: tuple[str, ...] = ()
    choices: Mapping[int, str] = field(default_factory=dict)  # value table: raw value -> name
    is_multiplexer: bool = False
    multiplexer: str | None = None  # the signal that selects this one
    multiplexer_ids: frozenset[int] = frozenset()  # values of the multiplexer under which this one is present
    uncertainty_of: str = ""  # `Message.Signal` whose standard deviation this one is; '' if of none

    def __post_init__(self) -> None:
        if self.is_float and self.length not in _FLOAT_BITS:
            raise ValueError(f"signal {self.name}: a float of {self.length} bits; floats have 16, 32 or 64")
        if not (math.isfinite(self.scale) and math.isfinite(self.offset)) or self.scale == 0:
            raise ValueError(
                f"signal {self.name}: factor {self.scale}, offset {self.offset}; "
                "both must be finite and the factor not 0"
            )

    @property
    def first_bit(self) -> int:
        """Bits of the frame before the signal, counted in the signal's own byte order."""
        return 8 * (self.start // 8) + 7 - self.start % 8 if self.big_endian else self.start

    def shift(self, frame_bits: int) -> int:
        """Right shift that brings the signal down to bit 0 of the frame's bytes read as one integer."""
        return frame_bits - self.first_bit - self.length if self.big_endian else self.start

    @property
    def is_identity(self) -> bool:
        """Whether raw and physical value are the same number."""
        return self.scale == 1 and self.offset == 0

    @property
    def is_integer(self) -> bool:
        """Whether physical values are integers (integer raw value, integer factor and offset)."""
        return not self.is_float and isinstance(self.scale, int) and isinstance(self.offset, int)

    @property
    def raw_limits(self) -> tuple[int, int]:
        """Smallest and largest raw integer the bits can hold."""
        if self.signed:
            return -(1 << (self.length - 1)), (1 << (self.length - 1)) - 1
        return 0, (1 << self.length) - 1

    @property
    def raw_range(self) -> tuple[int, int]:
        """Smallest and largest raw integer inside the DBC's physical range (all bits if it gives none)."""
        lowest, highest = self.raw_limits
        if not self.has_range:
            return lowest, highest
        assert self.minimum is not None
        assert self.maximum is not None
        ends = sorted((bound - self.offset) / self.scale for bound in (self.minimum, self.maximum))
        # a bound is meant to lie on the grid; its decimal fraction need not do so exactly
        return max(lowest, math.ceil(ends[0] - 1e-3)), min(highest, math.floor(ends[1] + 1e-3))

    @property
    def has_range(self) -> bool:
        """Whether the DBC limits the physical value; [0|0] is DBC's way to say it does not."""
        return self.minimum is not None and self.maximum is not None and self.minimum < self.maximum

    @property
    def not_available(self) -> int | None:
        """Raw value that says "no value", or None if the signal has none.

        The value table's `not_available`; else, where the range leaves it free, J1939's all ones
        or, of a signed signal, the most negative number.
        """
        for raw, name in self.choices.items():
            if name == _NOT_AVAILABLE:
                return raw
        if self.is_float or self.choices:
            return None
        lowest, highest = self.raw_limits
        first, last = self.raw_range
        if self.signed:
            return lowest if first > lowest else None
        return highest if last < highest else None
