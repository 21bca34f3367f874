"""Decodes whole recordings for reports, checks and the diagnosis: every signal of a message at once, as an array.

Frames are read as 64-bit words, a signal is shifts and a mask, then raw * scale + offset as
cantools computes it, so that each value equals cantools' bit for bit. Integer signals stay
integers; what leaves 64 bits becomes an array of Python's integers. Integer signals are unpacked by a compiled
loop (`dbc.kernels.unpack`); floats and what leaves 64 bits by numpy.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, REMOTE
from dbc.database import Database, MessageCodec
from dbc.kernels.groups import Numbering, rows_by_group
from dbc.kernels.unpack import Plan, fits, kind_of, plan_of, unpack
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


@dataclass(frozen=True, slots=True)
class Grouped:
    """The rows of a table by what they are."""

    rows: Mapping[MessageCodec, NDArray[np.int64]]  # of each message that occurs, in the order of the table
    unknown: Mapping[int, int]  # `can_id` word -> frames that no database knows (remote and error frames too)


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
        self._codecs = tuple(self._names)
        self._place = {codec: place for place, codec in enumerate(self._codecs)}
        self._numbering = Numbering()
        self._message_of = np.empty(0, np.int64)  # place in `_codecs` by number of an identifier

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

    def name_of(self, codec: MessageCodec) -> str:
        """What a message is called here."""
        return self._names[codec]

    def decode(
        self, table: FrameTable, *, truncated: bool = False, grouped: Grouped | None = None
    ) -> dict[str, Columns]:
        """Columns by message name, for every message that occurs; other frames are passed over.

        A frame shorter than its message is passed over too; `short` counts those. truncated: its signals that lie within
        it are decoded, the others NaN, as cantools does with allow_truncated; not so for multiplexed messages.
        grouped: of the same table, where the caller has it.
        """
        found: dict[str, Columns] = {}
        for codec, rows in (grouped or self.grouped(table)).rows.items():
            if not truncated or codec.is_multiplexed:
                inside = table.length[rows] >= codec.length
                rows = rows if inside.all() else rows[inside]
            if rows.size:
                found[self._names[codec]] = decode_rows(codec, table, rows)
        return found

    def undecodable(self, table: FrameTable) -> dict[int, int]:
        """Frames per `can_id` word that no database knows (remote and error frames included)."""
        return dict(self.grouped(table).unknown)

    def short(self, table: FrameTable, *, grouped: Grouped | None = None) -> dict[str, int]:
        """Frames per message that carry fewer bytes than the DBC says."""
        counts = {
            self._names[codec]: int(np.count_nonzero(table.length[rows] < codec.length))
            for codec, rows in (grouped or self.grouped(table)).rows.items()
        }
        return {name: count for name, count in counts.items() if count}

    def grouped(self, table: FrameTable) -> Grouped:
        """Rows of each message. Several identifiers may be one message."""
        numbers, known = self._numbering.of(table.can_id), self._message_of.size
        places = [self._place_of(word) for word in self._numbering.words(known)]
        self._message_of = np.concatenate((self._message_of, np.array(places, np.int64)))
        none = len(self._codecs)
        rows, begins, counts = rows_by_group(numbers, self._message_of, none)
        words = self._numbering.words()
        occurring = sorted((words[number], number) for number in np.flatnonzero(counts).tolist())
        # messages in the order of their identifiers
        messages = dict.fromkeys(int(self._message_of[number]) for _, number in occurring)
        messages.pop(none, None)
        return Grouped(
            rows={self._codecs[m]: rows[begins[m] : begins[m + 1]] for m in messages},
            unknown={w: int(counts[number]) for w, number in occurring if self._message_of[number] == none},
        )

    def _place_of(self, word: int) -> int:
        codec = None if word & (ERROR | REMOTE) else self.codec_of(word)
        return len(self._codecs) if codec is None else self._place[codec]


@dataclass(frozen=True, slots=True)
class _Layout:
    """How the signals of a message are unpacked."""

    compiled: tuple[Signal, ...]  # by the compiled loop, in the order of the plan
    plan: Plan
    others: tuple[Signal, ...]  # by numpy
    selectors_first: tuple[Signal, ...]


_layouts: WeakKeyDictionary[MessageCodec, _Layout] = WeakKeyDictionary()


def _layout_of(codec: MessageCodec) -> _Layout:
    found = _layouts.get(codec)
    if found is None:
        compiled = tuple(
            signal
            for signal in codec.by_signal.values()
            if fits(signal, codec.length)
            and (signal.is_identity or not _overflows(np.dtype(np.int64), signal))
        )
        others = tuple(signal for signal in codec.by_signal.values() if signal not in compiled)
        plan = plan_of(compiled, codec.length)
        found = _layouts[codec] = _Layout(compiled, plan, others, tuple(_selectors_first(codec.layout)))
    return found


def decode_rows(codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64]) -> Columns:
    """Decode `rows` of `table`, all of them frames of `codec`; NaN for what lies outside a short frame."""
    layout = _layout_of(codec)
    # rounded up to whole 64-bit words, so that the bytes can be viewed as words without a copy
    room = -(-codec.length // 8) * 8
    data = table.data if table.data.shape[1] >= room else np.pad(table.data, ((0, 0), (0, room - 8)))
    frames = np.ascontiguousarray(data).view(np.uint64)
    real = np.empty((1 + len(layout.compiled), rows.size))
    whole = real.view(np.int64)
    unpack(frames, table.time_ns, rows, codec.length, *layout.plan, whole, real)
    physical: dict[str, NDArray[Any]] = {
        signal.name: real[place].view(kind_of(signal)) for place, signal in enumerate(layout.compiled, 1)
    }
    if layout.others:
        little = frames[rows]
        words = {False: little, True: _mirrored(little, codec.length)}
        for signal in layout.others:
            raw = raw_values(words[signal.big_endian], signal, codec.length)
            physical[signal.name] = physical_values(raw, signal)
    if int(table.length[rows].min(initial=255)) < codec.length:
        for signal in codec.by_signal.values():
            inside = table.length[rows] >= signal_end(signal, codec.length)
            if not inside.all():
                physical[signal.name] = _masked(physical[signal.name], inside)
    if codec.is_multiplexed:
        physical = _multiplexed(layout.selectors_first, physical)
    return Columns(
        codec=codec, time_s=real[0], signals={name: physical[name] for name in codec.signals}, rows=rows
    )


def _multiplexed(
    selectors_first: Iterable[Signal], physical: Mapping[str, NDArray[Any]]
) -> dict[str, NDArray[Any]]:
    """The values, NaN where a frame does not carry the signal."""
    signals: dict[str, NDArray[Any]] = {}
    selectors: dict[str, NDArray[Any]] = {}
    for signal in selectors_first:
        value = physical[signal.name]
        if signal.multiplexer is None:
            signals[signal.name] = selectors[signal.name] = value
        else:
            present = np.isin(selectors[signal.multiplexer], list(signal.multiplexer_ids))
            signals[signal.name] = _masked(value, present)
            # -1 is no selector value: signals under an absent multiplexer are then absent too
            selectors[signal.name] = np.where(present, value, -1)
    return signals


def kind_in_tables(signal: Signal) -> np.dtype[Any]:
    """The type of a signal's column in a file: the DBC decides it, whatever frames a recording has.

    A multiplexed signal is float; object, Python's integers beside NaN, where a float could not hold them all. An
    integer signal that lies outside a short frame has no value there.
    """
    kind = _physical_kind(signal)
    if signal.multiplexer is None or kind not in (np.dtype(np.int64), np.dtype(np.uint64)):
        return kind
    ends = (raw * signal.scale + signal.offset for raw in signal.raw_limits)
    exact = all(abs(end) <= _EXACT_IN_FLOAT for end in ends)
    return np.dtype(np.float64) if exact else np.dtype(object)


def _physical_kind(signal: Signal) -> np.dtype[Any]:
    """The type of a signal's physical values where every frame carries it."""
    if signal.is_float:
        return np.dtype(np.float64)
    unsigned_word = signal.length == _WORD and not signal.signed
    raw: np.dtype[Any] = np.dtype(np.uint64 if unsigned_word else np.int64)
    if signal.length > _WORD or (not signal.is_identity and _overflows(raw, signal)):
        return np.dtype(object if signal.is_integer else np.float64)
    return raw if signal.is_identity or signal.is_integer else np.dtype(np.float64)


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
