"""candump's filters, for `monitor`: which frames of one interface are shown.

    123:7FF    can_id & mask == 123 & mask         123~7FF    can_id & mask != 123 & mask
    #FFFF      error frames whose class is in the mask; without it none are shown
    j          all filters must match instead of any

Hexadecimal; an identifier of eight digits is a 29-bit one. The rules are those of raw CAN sockets
(net/can/af_can.c and raw.c of Linux), so that a hub or a file is filtered as an interface is.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from bus.frame import ERROR, EXTENDED, EXTENDED_MASK, REMOTE, STANDARD_MASK
from bus.user_error import UserError

INVERTED = 0x2000_0000
"""CAN_INV_FILTER in the identifier of a filter: it matches what its mask does not."""
_PAIR = re.compile(r"(?:0[xX])?([0-9a-fA-F]{1,8})([:~])(?:0[xX])?([0-9a-fA-F]{1,8})")
_ERRORS = re.compile(r"#(?:0[xX])?([0-9a-fA-F]{1,8})")
_LONG = 8
"""Digits of an identifier from which on it is a 29-bit one."""
_WORD = 0xFFFF_FFFF


class FilterError(UserError, ValueError):
    """A filter that is not valid for candump."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Filters:
    """The filters of one interface."""

    pairs: tuple[
        tuple[int, int], ...
    ] = ()  # (can_id, mask) as the kernel takes them, with INVERTED; (): all data frames
    errors: int = 0  # mask of error classes; 0: no error frame
    joined: bool = False  # all pairs must match, instead of any

    @classmethod
    def parse(cls, texts: Sequence[str]) -> Self:
        """The filters after an interface's name, one text each; FilterError names the one that is none."""
        pairs: list[tuple[int, int]] = []
        errors, joined = 0, False
        for text in texts:
            if match := _PAIR.fullmatch(text):
                pairs.append(_pair(match))
            elif match := _ERRORS.fullmatch(text):
                errors = int(match[1], 16) & EXTENDED_MASK
            elif text in ("j", "J"):
                joined = True
            else:
                raise FilterError(
                    f"filter '{text}': not ID:MASK, ID~MASK, #ERRORMASK or j, with at most 8 hexadecimal digits"
                )
        return cls(pairs=tuple(pairs), errors=errors, joined=joined)

    @property
    def pass_all_data(self) -> bool:
        """Whether every data frame passes, and no error frame."""
        return not self.pairs and not self.errors

    def passes(self, can_id: int) -> bool:
        """Whether a frame with this `can_id` word is shown."""
        if can_id & ERROR:  # the kernel matches it once: it cannot satisfy several joined filters
            return bool(can_id & self.errors) and not (self.joined and len(self.pairs) > 1)
        if not self.pairs:
            return True
        matched = (_matches(can_id, *pair) for pair in self.pairs)
        return all(matched) if self.joined else any(matched)


def _pair(match: re.Match[str]) -> tuple[int, int]:
    """One filter as the kernel applies it."""
    typed, kind, mask_text = match.groups()
    can_id, mask = int(typed, 16), int(mask_text, 16) & ~ERROR
    if match.start(2) == _LONG:  # as candump: eight digits mean 29 bits, also if the value is small
        can_id |= EXTENDED
    if mask & EXTENDED and not can_id & EXTENDED:
        # as af_can.c: an 11-bit filter that asks for "not extended" compares 11 bits only
        mask &= STANDARD_MASK | EXTENDED | REMOTE
    inverted = INVERTED if kind == "~" else can_id & INVERTED
    return can_id & mask & _WORD | inverted, mask


def _matches(can_id: int, wanted: int, mask: int) -> bool:
    return (can_id & mask == wanted & ~INVERTED) != bool(wanted & INVERTED)
