"""Decodes whole recordings for reports, checks and the diagnosis: every signal of a message at once, as an array.

Frames are read as 64-bit words, a signal is shifts and a mask, then raw * scale + offset as
cantools computes it, so that each value equals cantools' bit for bit. Integer signals stay
integers; what leaves 64 bits becomes an array of Python's integers.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, REMOTE
from dbc.database import Database, MessageCodec
from dbc.recordings.logfile import FrameTable
from dbc.signal import Signal

_FLOATS = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}
_WORD = 64
_EXACT_IN_FLOAT = 1 << 53


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """The decoded frames of one message."""

    codec: MessageCodec
    time_s: NDArray[np.float64]  # (n,) stamps [s], on the clock of the table
    # (n,) per signal, in the DBC's unit. A multiplexed signal is NaN where its frame does not carry it; its
    # integers are then floats, or Python's integers beside NaN where a float could not hold them all.
    signals: Mapping[str, NDArray[Any]]
    rows: NDArray[np.int64]  # (n,) rows of the table that the frames came from


class ColumnDecoder:
    """Decodes a table by one or several databases; the first that knows an identifier decides.

    A message whose name an earlier database has taken is called `Name@file`.
    """

    def __init__(self, *databases: Database) -> None:
        self._databases = databases
        self._names: dict[MessageCodec, str] = {}
        for database in databases:
            for codec in database.by_id.values():
                self._names[codec] = self._free_name(codec.name, Path(database.source).stem)

    def _free_name(self, name: str, source: str) -> str:
        taken = set(self._names.values())
        # two files may have the same stem: numbered on then
        choices = [name, f"{name}@{source}", *(f"{name}@{source}.{i}" for i in range(2, len(taken) + 3))]
        return next(choice for choice in choices if choice not in taken)

    def codec_of(self, can_id: int) -> MessageCodec | None:
        """The message of an identifier, by exact id first, else by J1939 parameter group."""
        for database in self._databases:
            if (codec := database.by_id.get(can_id)) is not None:
                return codec
        return next((codec for d in self._databases if (codec := d.match(can_id)) is not None), None)

    def decode(self, table: FrameTable, *, truncated: bool = False) -> dict[str, Columns]:
        """Columns by message name, for every message that occurs; other frames are passed over.

        A frame shorter than its message is passed over too; `short` counts those. truncated: its signals that lie within
        it are decoded, the others NaN, as cantools does with allow_truncated; not so for multiplexed messages.
        """
        found: dict[str, Columns] = {}
        for codec, rows in self._grouped(table).items():
            if not truncated or codec.is_multiplexed:
                rows = rows[table.length[rows] >= codec.length]
            if rows.size:
                found[self._names[codec]] = decode_rows(codec, table, rows)
        return found

    def undecodable(self, table: FrameTable) -> dict[int, int]:
        """Frames per `can_id` word that no database knows (remote and error frames included)."""
        words, counts = np.unique(table.can_id, return_counts=True)
        return {
            word: count
            for word, count in zip(words.tolist(), counts.tolist(), strict=True)
            if word & (ERROR | REMOTE) or self.codec_of(word) is None
        }

    def short(self, table: FrameTable) -> dict[str, int]:
        """Frames per message that carry fewer bytes than the DBC says."""
        counts = {
            self._names[codec]: int(np.count_nonzero(table.length[rows] < codec.length))
            for codec, rows in self._grouped(table).items()
        }
        return {name: count for name, count in counts.items() if count}

    def _grouped(self, table: FrameTable) -> dict[MessageCodec, NDArray[np.int64]]:
        """Rows of each message, in the order of the table. Several identifiers may be one message."""
        # one sort instead of one comparison per identifier: a recording may hold hundreds of identifiers
        order = np.argsort(table.can_id, kind="stable")
        ranked = table.can_id[order]
        bounds = [0, *(np.flatnonzero(np.diff(ranked)) + 1).tolist(), len(ranked)]
        groups: dict[MessageCodec, list[NDArray[np.int64]]] = {}
        for start, end in pairwise(bounds if len(ranked) else []):
            word = int(ranked[start])
            codec = None if word & (ERROR | REMOTE) else self.codec_of(word)
            if codec is not None:
                groups.setdefault(codec, []).append(order[start:end])
        return {
            codec: parts[0] if len(parts) == 1 else np.sort(np.concatenate(parts))
            for codec, parts in groups.items()
        }


def decode_rows(codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64]) -> Columns:
    """Decode `rows` of `table`, all of them frames of `codec`; NaN for what lies outside a short frame."""
    # rounded up to whole 64-bit words, so that the bytes can be viewed as words without a copy
    room = -(-codec.length // 8) * 8
    data = table.data if table.data.shape[1] >= room else np.pad(table.data, ((0, 0), (0, room - 8)))
    little = data.view("<u8")[rows]
    orders = {signal.big_endian for signal in codec.layout}
    words = {big: _mirrored(little, codec.length) if big else little for big in orders}
    signals: dict[str, NDArray[Any]] = {}
    selectors: dict[str, NDArray[Any]] = {}
    for signal in _selectors_first(codec.layout):
        value = physical_values(raw_values(words[signal.big_endian], signal, codec.length), signal)
        inside = table.length[rows] >= signal_end(signal, codec.length)
        if not inside.all():
            value = _masked(value, inside)
        if signal.multiplexer is None:
            signals[signal.name] = selectors[signal.name] = value
        else:
            present = np.isin(selectors[signal.multiplexer], list(signal.multiplexer_ids))
            signals[signal.name] = _masked(value, present)
            # -1 is no selector value: signals under an absent multiplexer are then absent too
            selectors[signal.name] = np.where(present, value, -1)
    return Columns(
        codec=codec,
        time_s=np.asarray(table.time_ns[rows] / 1e9, np.float64),
        signals={name: signals[name] for name in codec.signals},
        rows=rows,
    )


def signal_end(signal: Signal, length: int) -> int:
    """Bytes that a frame of a message of `length` bytes must have to carry the signal."""
    shift = signal.shift(8 * length)
    return length - shift // 8 if signal.big_endian else (shift + signal.length + 7) // 8


def _mirrored(words: NDArray[np.uint64], length: int) -> NDArray[np.uint64]:
    """The first `length` bytes of each frame in reverse, so that Motorola signals lie as Intel ones do."""
    mirrored = np.zeros((len(words), 8 * words.shape[1]), np.uint8)
    # Motorola numbering counts from the other end: on reversed bytes one shift-and-mask serves both orders
    mirrored[:, :length] = words.view(np.uint8)[:, length - 1 :: -1] if length else 0
    return mirrored.view("<u8")


def _selectors_first(layout: Iterable[Signal]) -> list[Signal]:
    """Multiplexers before what they select."""
    by_name = {signal.name: signal for signal in layout}

    def depth(signal: Signal) -> int:
        return 0 if signal.multiplexer is None else 1 + depth(by_name[signal.multiplexer])

    return sorted(by_name.values(), key=depth)


def _masked(values: NDArray[Any], present: NDArray[np.bool_]) -> NDArray[Any]:
    """The values, NaN where they are not present."""
    fits = values.dtype == np.float64 or (
        values.dtype != object and (values.size == 0 or _largest(values) <= _EXACT_IN_FLOAT)
    )
    return np.where(present, values if fits else values.astype(object), np.nan)


def _largest(values: NDArray[Any]) -> int:
    return max(abs(int(values.min())), abs(int(values.max())))


def raw_values(words: NDArray[np.uint64], signal: Signal, length: int) -> NDArray[Any]:
    """Raw values (n,) of a signal of a message of `length` bytes: int64, uint64, float64 or Python's integers.

    words: (n, k), word j holding bits 64 j onwards of the frame read as one integer in the signal's byte order.
    """
    shift = signal.shift(8 * length)
    if signal.length > _WORD:
        return _wide(words, shift, signal)
    first, bit = divmod(shift, _WORD)
    value = words[:, first] >> np.uint64(bit)
    # the signal crosses the border between two words
    if bit + signal.length > _WORD:
        value |= words[:, first + 1] << np.uint64(_WORD - bit)
    if signal.length < _WORD:
        value &= np.uint64((1 << signal.length) - 1)
    if signal.is_float:
        bits, kind = _FLOATS[signal.length]
        with np.errstate(invalid="ignore"):  # a signalling NaN is a value like any other
            return value.astype(bits).view(kind).astype(np.float64)
    if signal.length == _WORD:
        return value.view(np.int64) if signal.signed else value
    if signal.signed:
        sign = np.int64(1 << (signal.length - 1))
        return (value.view(np.int64) ^ sign) - sign
    return value.view(np.int64)


def _wide(words: NDArray[np.uint64], shift: int, signal: Signal) -> NDArray[Any]:
    """Raw values of more than 64 bits, which only CAN FD has room for: one by one."""
    mask, sign = (1 << signal.length) - 1, 1 << (signal.length - 1) if signal.signed else 0
    frames = (int.from_bytes(row.tobytes(), "little") for row in words)
    values = np.empty(len(words), object)
    values[:] = [((frame >> shift & mask) ^ sign) - sign for frame in frames]
    return values


def physical_values(raw: NDArray[Any], signal: Signal) -> NDArray[Any]:
    """raw * scale + offset, with cantools' order of operations and its integers."""
    if signal.is_identity:
        return raw
    if raw.dtype == object or _overflows(raw.dtype, signal):
        exact = np.empty(raw.size, object)
        exact[:] = [value * signal.scale + signal.offset for value in raw.tolist()]
        return exact if signal.is_integer else exact.astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        return raw * signal.scale + signal.offset


def _overflows(kind: np.dtype[Any], signal: Signal) -> bool:
    """Whether numpy's integers cannot hold what Python's, and so cantools', can."""
    if signal.is_float or not isinstance(signal.scale, int):
        return False
    products = [raw * signal.scale for raw in signal.raw_limits]
    sums = [product + signal.offset for product in products] if signal.is_integer else []
    limits = np.iinfo(kind)
    return not all(limits.min <= value <= limits.max for value in (*products, *sums))
