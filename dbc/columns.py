"""Decodes whole recordings: every signal of a message at once, as an array.

Bit extraction on uint64 words, then raw * scale + offset as cantools computes it, so that
each value equals cantools' bit for bit. Integer signals stay integers.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, REMOTE
from dbc.database import Database, MessageCodec
from dbc.logfile import FrameTable
from dbc.signal import Signal

_FLOATS = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """The frames of one message: times (n,) [s], and each signal (n,) in the DBC's unit.

    A multiplexed signal is NaN (a masked integer becomes float) where its frame does not carry it.
    rows: (n,) rows of the table the frames came from.
    """

    codec: MessageCodec
    time_s: NDArray[np.float64]
    signals: Mapping[str, NDArray[Any]]
    rows: NDArray[np.int64]


class ColumnDecoder:
    """Decodes a table by one or several databases; the first that knows an identifier decides."""

    def __init__(self, *databases: Database) -> None:
        self._databases = databases

    def codec_of(self, can_id: int) -> MessageCodec | None:
        """The message of an identifier, by exact id first, else by J1939 parameter group."""
        for database in self._databases:
            if (codec := database.by_id.get(can_id)) is not None:
                return codec
        return next((codec for d in self._databases if (codec := d.match(can_id)) is not None), None)

    def decode(self, table: FrameTable) -> dict[str, Columns]:
        """Columns by message name, for every message that occurs; other frames are passed over.

        A frame shorter than its message is passed over too; `short` counts those.
        """
        found: dict[str, Columns] = {}
        for name, (codec, rows) in self._grouped(table).items():
            usable = rows[table.length[rows] >= codec.length]
            if usable.size:
                found[name] = decode_rows(codec, table, usable)
        return found

    def undecodable(self, table: FrameTable) -> dict[int, int]:
        """Frames per `can_id` word that no database knows (remote and error frames included)."""
        words, counts = np.unique(table.can_id, return_counts=True)
        return {
            int(word): int(count)
            for word, count in zip(words, counts, strict=True)
            if int(word) & (ERROR | REMOTE) or self.codec_of(int(word)) is None
        }

    def short(self, table: FrameTable) -> dict[str, int]:
        """Frames per message that carry fewer bytes than the DBC says."""
        counts = {
            name: int(np.count_nonzero(table.length[rows] < codec.length))
            for name, (codec, rows) in self._grouped(table).items()
        }
        return {name: count for name, count in counts.items() if count}

    def _grouped(self, table: FrameTable) -> dict[str, tuple[MessageCodec, NDArray[np.int64]]]:
        """Rows of each message, in the order of the table. Several identifiers may be one message."""
        order = np.argsort(table.can_id, kind="stable")
        words, starts = np.unique(table.can_id[order], return_index=True)
        groups: dict[str, tuple[MessageCodec, list[NDArray[np.int64]]]] = {}
        for word, rows in zip(words, np.split(order, starts[1:]), strict=True):
            codec = None if int(word) & (ERROR | REMOTE) else self.codec_of(int(word))
            if codec is not None:
                groups.setdefault(codec.name, (codec, []))[1].append(rows)
        return {
            name: (codec, parts[0] if len(parts) == 1 else np.sort(np.concatenate(parts)))
            for name, (codec, parts) in groups.items()
        }


def decode_rows(codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64]) -> Columns:
    """Decode `rows` of `table`, all of them frames of `codec` and long enough."""
    frames = np.ascontiguousarray(table.data[rows, : codec.length])
    signals: dict[str, NDArray[Any]] = {}
    raw_selectors: dict[str, NDArray[Any]] = {}
    for signal in _selectors_first(codec.layout):
        raw = raw_values(frames, signal)
        value = physical_values(raw, signal)
        present = _present(signal, raw_selectors, len(rows))
        if signal.is_multiplexer:
            raw_selectors[signal.name] = value if present is None else np.where(present, value, -1)
        signals[signal.name] = value if present is None else np.where(present, value, np.nan)
    ordered = {name: signals[name] for name in codec.signals}
    return Columns(
        codec=codec, time_s=np.asarray(table.time_ns[rows] * 1e-9, np.float64), signals=ordered, rows=rows
    )


def _selectors_first(layout: Iterable[Signal]) -> list[Signal]:
    """Multiplexers before what they select."""
    by_name = {signal.name: signal for signal in layout}

    def depth(signal: Signal) -> int:
        return 0 if signal.multiplexer is None else 1 + depth(by_name[signal.multiplexer])

    return sorted(by_name.values(), key=depth)


def _present(signal: Signal, selectors: Mapping[str, NDArray[Any]], count: int) -> NDArray[np.bool_] | None:
    """Where the signal is carried; None if everywhere."""
    if signal.multiplexer is None:
        return None
    return np.isin(selectors[signal.multiplexer], list(signal.multiplexer_ids))


def raw_values(frames: NDArray[np.uint8], signal: Signal) -> NDArray[Any]:
    """Raw values of a signal. frames: (n, length) bytes; returns (n,) int64, uint64 or float64."""
    count, length = frames.shape
    if signal.big_endian:
        frames = frames[:, ::-1]
    shift = signal.shift(8 * length)
    first, last = shift // 8, (shift + signal.length - 1) // 8
    word = np.zeros(count, np.uint64)
    for place, byte in enumerate(range(first, min(last, first + 7) + 1)):
        word |= frames[:, byte].astype(np.uint64) << np.uint64(8 * place)
    word >>= np.uint64(shift % 8)
    if last > first + 7:  # an unaligned signal of more than 56 bits spans nine bytes
        word |= frames[:, last].astype(np.uint64) << np.uint64(64 - shift % 8)
    if signal.length < 64:
        word &= np.uint64((1 << signal.length) - 1)
    if signal.is_float:
        bits, kind = _FLOATS[signal.length]
        with np.errstate(invalid="ignore"):  # a signalling NaN is a value like any other
            return word.astype(bits).view(kind).astype(np.float64)
    if signal.length == 64:
        return word.view(np.int64) if signal.signed else word
    value = word.view(np.int64)
    if signal.signed:
        sign = 1 << (signal.length - 1)
        return (value ^ sign) - sign
    return value


def physical_values(raw: NDArray[Any], signal: Signal) -> NDArray[Any]:
    """raw * scale + offset, with cantools' order of operations and its integers."""
    if signal.is_identity:
        return raw
    if signal.is_integer and _overflows(signal):
        exact = [int(value) * signal.scale + signal.offset for value in raw.tolist()]
        return np.array(exact, object)
    with np.errstate(invalid="ignore", over="ignore"):
        return raw * signal.scale + signal.offset


def _overflows(signal: Signal) -> bool:
    """Whether an integer signal's values leave 64 bits; Python's integers, as cantools', do not."""
    ends = [raw * signal.scale + signal.offset for raw in signal.raw_limits]
    return max(abs(int(end)) for end in ends) >= 1 << 63
