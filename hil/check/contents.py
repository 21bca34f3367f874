"""Compares the contents of the frames of one message with the DBC: length, CRC, counter, ranges, value tables. Pure.

Only the rules of the DBC are applied: a message without E2EProfile has no CRC, a signal without a range no bounds.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dbc.columns import decode_rows
from dbc.database import MessageCodec
from dbc.protection import Checker, Finding
from dbc.recordings.logfile import FrameTable
from dbc.signal import Signal
from hil.verdict import Result, Verdict

QUESTION = "every frame intact: length and CRC as the DBC says"


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


def contents_of(
    name: str, channel: str, codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64]
) -> Contents:
    """The counts of the rows of one message."""
    right = rows[table.length[rows] == codec.length]
    foreign_crc, never_sent = _protection(codec, table, right)
    # values of frames with a wrong CRC mean nothing
    whole = right[~foreign_crc]
    outside, undefined, example = _values(codec, table, whole)
    return Contents(
        name=name,
        channel=channel,
        frames=int(rows.size),
        wrong_length=int(rows.size - right.size),
        wrong_crc=int(foreign_crc.sum()),
        wrong_counter=int(never_sent.sum()),
        outside=outside,
        undefined=undefined,
        example=example,
    )


def _protection(
    codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Of each frame whether its CRC is wrong, and whether its counter is never sent; neither without protection."""
    wrong_crc, never_sent = np.zeros((2, rows.size), np.bool_)
    if codec.protection is None:
        return wrong_crc, never_sent
    checker = Checker(codec)
    for place, row in enumerate(rows.tolist()):
        found = checker.check(table.data[row, : codec.length].tobytes(), int(table.time_ns[row]))
        wrong_crc[place] = found in (Finding.WRONG_CRC, Finding.MASQUERADED)
        never_sent[place] = found is Finding.WRONG_COUNTER
    return wrong_crc, never_sent


def _values(
    codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64]
) -> tuple[dict[str, int], dict[str, int], str]:
    """Signals with values outside range or value table, and the first of them in words."""
    outside: dict[str, int] = {}
    undefined: dict[str, int] = {}
    example = ""
    if not rows.size:
        return outside, undefined, example
    for signal in codec.layout:
        values = np.asarray(decode_rows(codec, table, rows).signals[signal.name], float)
        for kind, bad in (
            ("range", outside_range(signal, values)),
            ("value table", not_in_table(signal, values)),
        ):
            if bad.any():
                (outside if kind == "range" else undefined)[signal.name] = int(bad.sum())
                first = float(values[bad][0])
                example = (
                    example or f"{signal.name} = {first:g} {signal.unit}".rstrip() + f" is not in its {kind}"
                )
    return outside, undefined, example


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


def judge_contents(found: Iterable[Contents]) -> Verdict:
    """Whether every frame had its length and its CRC; ranges and value tables are counted and decide nothing."""
    every = list(found)
    broken = [f"{each.name}: {', '.join(each.broken)}" for each in every if each.broken]
    if broken:
        more = f"; and {len(broken) - 3} more messages" if len(broken) > 3 else ""
        return Verdict(question=QUESTION, result=Result.FAILED, reason="; ".join(broken[:3]) + more)
    count = sum(each.frames for each in every)
    if not count:
        return Verdict(
            question=QUESTION, result=Result.INCONCLUSIVE, reason="no frame of any message of the DBC"
        )
    return Verdict(question=QUESTION, result=Result.PASSED, reason=f"{count} frames of {len(every)} messages")
