"""Recordings of CAN frames through DBC files as columns: `Message.Signal`, and `Signal` where only one message has it.

Values outside the DBC's range have two causes. One or two different codes mean "error" or "not available" (SAE J1939-71): they are counted
and dropped. Many different values mean that the range in the DBC is wrong, which is common: they are kept, with a complaint.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dbc.columns import ColumnDecoder, Columns
from dbc.database import Database
from dbc.errors import LogError
from dbc.recordings.reading import read_frames
from diagnosis.reading.tables import Column, Table, Unreadable

SHOWN = 3  # messages about damaged places, per file
CODES = 2  # different values outside the range: error, and not available
MARGIN = 1e-6  # share of the range: a value on its edge may decode to slightly more


def decoder(files: Sequence[Path]) -> ColumnDecoder:
    """A decoder with the messages of all DBC files. Raises DatabaseError."""
    return ColumnDecoder(*(Database.from_file(file, strict=False) for file in files))


def read_can(path: Path, through: ColumnDecoder, bus: str | None = None) -> Table:
    """A table with a column for every signal of every known message; bus: only frames of this bus of the log. Raises Unreadable."""
    try:
        frames = read_frames(path)
    except LogError as error:
        raise Unreadable(f"{path.name}: {str(error).removeprefix(f'{path}: ')}") from error
    if bus is not None:
        if bus not in frames.channels:
            raise Unreadable(f"{path.name}: has no bus '{bus}'; it has {', '.join(frames.channels)}")
        frames = frames.select(frames.channel == frames.channels.index(bus))
    decoded = through.decode(frames)
    if not decoded:
        raise Unreadable(f"{path.name}: none of its {len(frames)} frames is in the DBC files given")
    columns = [column for name, message in decoded.items() for column in _columns(name, message)]
    # "Speed" for "Vehicle.Speed", unless another message has a Speed as well: the short name must never be ambiguous
    plain = Counter(c.name.partition(".")[2] for c in columns)
    columns += [
        Column(short, c.unit, c.time_s, c.value, c.damage)
        for c in columns
        if plain[short := c.name.partition(".")[2]] == 1
    ]
    skipped = [f"{damage}" for damage in frames.damaged[:SHOWN]]
    if frames.damaged_count > SHOWN:
        skipped.append(f"{frames.damaged_count} damaged places in all")
    return Table(columns, {}, skipped)


def _columns(name: str, message: Columns) -> list[Column]:
    """The signals of one message, without samples that are codes."""
    found = []
    for signal, raw in message.signals.items():
        described = message.codec.by_signal[signal]
        # integers wider than 64 bits arrive as objects, which astype cannot convert
        value = np.array([float(v) for v in raw]) if raw.dtype == object else raw.astype(float)
        low, high = described.minimum, described.maximum
        damage, there = "", np.ones(value.size, bool)
        if low is not None and high is not None and low < high:
            room = MARGIN * (high - low)
            outside = (value < low - room) | (value > high + room)
            codes = np.unique(value[outside]).size
            if codes:
                what = (
                    "not available"
                    if codes <= CODES
                    else "kept, because the range in the DBC seems to be wrong"
                )
                damage = f"{np.count_nonzero(outside)} of {value.size} values outside {low:g} to {high:g} {described.unit}: {what}"
            if codes and codes <= CODES:
                there = ~outside
        found.append(Column(f"{name}.{signal}", described.unit, message.time_s[there], value[there], damage))
    return found
