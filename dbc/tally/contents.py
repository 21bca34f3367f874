"""Counts the frames of one message that break the DBC: length, CRC, counter, ranges, value tables. Pure.

Only the rules of the DBC are applied: a message without E2EProfile has no CRC, a signal without a range no bounds.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dbc.columns import decode_rows
from dbc.database import MessageCodec
from dbc.kernels.checksums import COUNTER_NEVER_SENT, INTACT, WRONG_CRC, check_profile1
from dbc.recordings.logfile import FrameTable
from dbc.signal import Signal

_FEW = 256
"""Different values up to which each of them is looked up in a value table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """Frames of one message, and how many break which rule."""

    name: str
    channel: str
    frames: int  # frames checked
    wrong_length: int = 0
    wrong_crc: int = 0
    wrong_counter: int = 0
    outside: dict[str, int]  # signal -> number of values outside its range
    undefined: dict[str, int]  # signal -> number of values that its value table does not name
    example: str = ""  # the first of those values, in plain text

    @property
    def broken(self) -> list[str]:
        """The counts of frames that a receiver must not use, as text; [] if there are none."""
        counts = (
            (self.wrong_length, "of wrong length"),
            (self.wrong_crc, "with a wrong CRC"),
            (self.wrong_counter, "with counter 15, which is never sent"),
        )
        return [f"{count} of {self.frames} frames {what}" for count, what in counts if count]


class ContentsCount:
    """Takes the frames of one message."""

    def __init__(self, codec: MessageCodec) -> None:
        self._codec = codec
        self.frames = self._wrong_length = self._wrong_crc = self._wrong_counter = 0
        self._bad = dict.fromkeys(codec.signals, 0)  # values that break the signal's range or table
        self._first: dict[str, float] = {}  # the first of them

    def add(self, table: FrameTable, rows: NDArray[np.int64]) -> None:
        """Count these rows of a table."""
        self.frames += rows.size
        of_length = table.length[rows] == self._codec.length
        right = rows if of_length.all() else rows[of_length]
        self._wrong_length += rows.size - right.size
        found = _protection(self._codec, table, right)
        if found is not None:
            wrong_crc = found == WRONG_CRC
            self._wrong_crc += int(np.count_nonzero(wrong_crc))
            self._wrong_counter += int(np.count_nonzero(found == COUNTER_NEVER_SENT))
            # values of frames with a wrong CRC mean nothing
            right = right[~wrong_crc] if wrong_crc.any() else right
        if right.size:
            self._count_values(table, right)

    def counted(self, name: str, channel: str) -> Contents:
        """All counts so far. name, channel: what the message is called."""
        by_signal = self._codec.by_signal
        bad = {signal: count for signal, count in self._bad.items() if count}
        example = ""
        for signal in list(bad)[:1]:
            rule = "value table" if by_signal[signal].choices else "range"
            value = f"{signal} = {self._first[signal]:g} {by_signal[signal].unit}".rstrip()
            example = f"{value} is not in its {rule}"
        return Contents(
            name=name,
            channel=channel,
            frames=self.frames,
            wrong_length=self._wrong_length,
            wrong_crc=self._wrong_crc,
            wrong_counter=self._wrong_counter,
            outside={signal: count for signal, count in bad.items() if not by_signal[signal].choices},
            undefined={signal: count for signal, count in bad.items() if by_signal[signal].choices},
            example=example,
        )

    def _count_values(self, table: FrameTable, rows: NDArray[np.int64]) -> None:
        decoded = decode_rows(self._codec, table, rows).signals
        for signal in self._codec.layout:
            if not (signal.choices or signal.has_range) or _plainly_allowed(signal, decoded[signal.name]):
                continue
            values = np.asarray(decoded[signal.name], float)
            # a value table stands in for a range
            bad = (not_in_table if signal.choices else outside_range)(signal, values)
            if bad.any():
                self._bad[signal.name] += int(bad.sum())
                self._first.setdefault(signal.name, float(values[bad][0]))


def _protection(codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64]) -> NDArray[np.uint8] | None:
    """Of each frame INTACT, WRONG_CRC or COUNTER_NEVER_SENT; None without protection."""
    protection = codec.protection
    if protection is None:
        return None
    if codec.profile is not None:
        return check_profile1(codec.profile, table.data, rows, codec.length)
    found = np.full(rows.size, INTACT, np.uint8)
    for place, row in enumerate(rows.tolist()):
        data = table.data[row, : codec.length].tobytes()
        if not protection.intact(data):
            found[place] = WRONG_CRC
        elif protection.counter(data) >= protection.counters:
            found[place] = COUNTER_NEVER_SENT
    return found


def _plainly_allowed(signal: Signal, values: NDArray[Any]) -> bool:
    """Whether the least and the greatest value show that all are allowed, which nearly always is so."""
    if values.dtype == object:
        return False
    least, greatest = values.min(), values.max()
    if not signal.choices:
        assert signal.minimum is not None
        assert signal.maximum is not None
        slack = abs(signal.scale) / 2
        # not so where one of them is NaN
        return bool(float(least) >= signal.minimum - slack and float(greatest) <= signal.maximum + slack)
    if values.dtype.kind not in "iu" or not signal.is_identity or int(greatest) - int(least) >= _FEW:
        return False
    return all(value in signal.choices for value in range(int(least), int(greatest) + 1))


def outside_range(signal: Signal, values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which values (n,), in the DBC's unit, break the range; a value table stands in for one."""
    if not signal.has_range or signal.choices:
        return np.zeros(values.size, bool)
    assert signal.minimum is not None
    assert signal.maximum is not None
    slack = abs(signal.scale) / 2  # a bound need not lie on the signal's grid
    bad = (values < signal.minimum - slack) | (values > signal.maximum + slack)
    # "not available" lies outside the range by design (J1939)
    if (absent := signal.not_available) is not None:
        bad &= np.abs(values - (absent * signal.scale + signal.offset)) > slack
    return bad


def not_in_table(signal: Signal, values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which values (n,) the value table does not name; none without a table."""
    if not signal.choices:
        return np.zeros(values.size, bool)
    known = np.array([raw * signal.scale + signal.offset for raw in signal.choices], float)
    return ~np.isin(values, known) & ~np.isnan(values)
