"""Decodes a recording piece by piece through DBC files; the memory does not grow with its length.

Values are the DBC's physical values, equal to cantools' bit for bit.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dbc.columns import ColumnDecoder, Columns, Grouped
from dbc.database import MessageCodec
from dbc.errors import LogError
from dbc.recordings.logfile import Damage, FrameTable
from dbc.recordings.reading import Progress, read_pieces

Take = Callable[[FrameTable, Mapping[str, Columns]], None]
"""Receives the frames of a piece and the columns of its messages by name."""


@dataclass(slots=True)
class Occurrence:
    """The decoded frames of one message in a recording."""

    codec: MessageCodec
    first_s: float  # stamp of the first frame in the file [s]
    last_s: float
    frames: int = 0


@dataclass(slots=True)
class Decoded:
    """One recording, decoded: everything but the values."""

    path: Path
    frames: int = 0
    messages: dict[str, Occurrence] = field(default_factory=dict)
    undecodable: Counter[int] = field(default_factory=Counter)  # can_id word -> frames that no DBC knows
    short: Counter[str] = field(default_factory=Counter)  # message -> frames shorter than the DBC says
    damaged: tuple[Damage, ...] = ()
    damaged_count: int = 0


def decode_log(
    path: Path,
    decoder: ColumnDecoder,
    progress: Progress | None = None,
    channel: str | None = None,
    take: Take | None = None,
) -> Decoded:
    """Read one recording, or one channel of it, and hand its columns to `take`; without `take` the frames are only counted.

    Of frames shorter than their message the signals within them are decoded, but of multiplexed messages none.
    LogError when it cannot be read or has no such channel; `take` may have received pieces by then.
    """
    done = Decoded(path)
    channels: tuple[str, ...] = ()
    for piece in read_pieces(path, progress):
        done.damaged += piece.damaged
        done.damaged_count += piece.damaged_count
        channels = piece.channels
        table = piece if channel is None else _on_channel(piece, channel)
        if len(table):
            grouped = decoder.grouped(table)
            _count(done, table, decoder, grouped)
            if take is not None:
                take(table, decoder.decode(table, truncated=True, grouped=grouped))
    if channel is not None and channel not in channels:
        raise LogError(f"{path}: no channel {channel!r}; there are {', '.join(channels)}")
    return done


def _on_channel(table: FrameTable, name: str) -> FrameTable:
    """The rows of one channel; none where it has not occurred yet."""
    number = table.channels.index(name) if name in table.channels else -1
    selected = table.select(table.channel == number)
    return replace(selected, channel=np.zeros_like(selected.channel), channels=(name,))


def _count(done: Decoded, table: FrameTable, decoder: ColumnDecoder, grouped: Grouped) -> None:
    done.frames += len(table)
    done.undecodable.update(grouped.unknown)
    done.short.update(decoder.short(table, grouped=grouped))
    for codec, every in grouped.rows.items():
        rows = every[table.length[every] >= codec.length] if codec.is_multiplexed else every
        if rows.size:
            name, last_s = decoder.name_of(codec), float(table.time_ns[rows[-1]]) / 1e9
            if name not in done.messages:
                done.messages[name] = Occurrence(codec, float(table.time_ns[rows[0]]) / 1e9, last_s)
            done.messages[name].frames += rows.size
            done.messages[name].last_s = last_s
