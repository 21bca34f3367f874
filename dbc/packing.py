"""Encodes many messages from one vector of SI values in one compiled call, for the senders of plant and ECU.

The bytes are those of `Binding.encode` and `Protector`, which make one frame at a time and are the
reference in the tests; a loop that sends twenty frames per tick needs a tenth of their time here.
Holds for integer signals of up to 52 bits, which a float's mantissa carries exactly.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from bus.machine_code import direct
from bus.rows import CLASSIC, LAYOUT, Rows
from dbc import codegen
from dbc.binding import Binding, resting
from dbc.compiled import packing as compiled
from dbc.database import MessageCodec
from dbc.kernels.checksums import CRC_TABLE
from dbc.protection import COUNTERS
from dbc.signal import Signal

Signals = Mapping[str, tuple[str, str]]
"""Of one message: signal -> (SI unit, name of the value that goes into it)."""

MOST_BITS: Final = 52

# Columns of the table of messages: their rows of the signal tables, bytes, data id of the protection or -1.
M_FIRST, M_LAST, M_LENGTH, M_DATA_ID = range(4)
# Columns of the signal tables: where the bits lie and which value they hold, and what they mean.
P_SOURCE, P_FIRST_BIT, P_BITS, P_BIG_ENDIAN = range(4)
N_FACTOR, N_OFFSET, N_SCALE, N_LOWEST, N_HIGHEST, N_ABSENT = range(6)

_made = tuple.__new__


class Packer:
    """Makes frames of `messages`; counts and signs those that are protected.

    sources: names of the values in the order of the vector; by default as the messages first name them.
    """

    def __init__(
        self, messages: Sequence[tuple[MessageCodec, Signals]], sources: Sequence[str] | None = None
    ) -> None:
        named = dict.fromkeys(source for _, signals in messages for _, source in signals.values())
        self.sources = tuple(named if sources is None else sources)
        place_of = {name: i for i, name in enumerate(self.sources)}
        self._codecs = [codec for codec, _ in messages]
        self._chosen: list[tuple[MessageCodec, Signal]] = []
        spans: list[tuple[int, ...]] = []
        places: list[tuple[int, ...]] = []
        numbers: list[tuple[float, ...]] = []
        for codec, signals in messages:
            binding = Binding(codec, {name: unit for name, (unit, _) in signals.items()})
            first = len(places)
            for (name, (_, source)), factor in zip(signals.items(), binding.factors, strict=True):
                signal = codec.by_signal[name]
                places.append((place_of[source], signal.first_bit, signal.length, signal.big_endian))
                numbers.append(_numbers(codec, signal, factor))
                self._chosen.append((codec, signal))
            spans.append((first, len(places), codec.length, _data_id(codec)))
        self._messages = np.array(spans, np.int64)
        self._places = np.array(places, np.int64)
        self._numbers = np.array(numbers, np.float64)
        self._resting = _resting_frames(messages)
        self._counters = np.zeros(len(messages), np.int64)
        # scratch rows that every call overwrites; `tobytes` below copies them out
        self._frames = np.zeros_like(self._resting)
        due, vector = np.zeros(1, np.int64), np.zeros(len(self.sources))
        tables = self._messages, self._places, self._numbers, self._resting, self._counters
        self._pack = direct(pack_frames, due, vector, *tables, self._frames)

    def plan(self, due: Sequence[int]) -> "Plan":
        """What `pack` needs to make the messages of the given numbers, in their order."""
        return Plan(due, [self._codecs[number] for number in due], self._frames)

    def pack(self, plan: "Plan", values: NDArray[np.float64], at_ns: int = 0) -> list[Frame]:
        """The frames of a plan; values: SI, in the order of `sources`. EncodeError names a value that cannot be sent."""
        self.fill(plan, values)
        data = self._frames.tobytes()
        # not by Frame(...): half of the time of making one is the call
        return [_made(Frame, (can_id, data[start:stop], at_ns, 0)) for can_id, start, stop in plan.cuts]

    def fill(self, plan: "Plan", values: NDArray[np.float64]) -> Rows:
        """The same as rows, one for each message of the plan, which the next call overwrites."""
        failed = self._pack(
            plan.due,
            values,
            self._messages,
            self._places,
            self._numbers,
            self._resting,
            self._counters,
            self._frames,
        )
        if failed >= 0:
            self._refuse(failed, values)
        return plan.rows

    def pack_many(
        self, plans: Sequence["Plan"], values: NDArray[np.float64], stamps_ns: Sequence[int]
    ) -> NDArray[np.void]:
        """The frames of each plan with its row of values and its stamp, as a table of bus.rows.LAYOUT; of messages of at most CLASSIC bytes."""
        counts = [plan.due.size for plan in plans]
        starts = np.array([0, *accumulate(counts)], np.int64)
        frames = np.empty((starts[-1], self._resting.shape[1]), np.uint8)
        due = np.concatenate([plan.due for plan in plans]) if plans else np.empty(0, np.int64)
        tick, failed = pack_rows(
            starts,
            due,
            values,
            self._messages,
            self._places,
            self._numbers,
            self._resting,
            self._counters,
            frames,
        )
        if failed >= 0:
            self._refuse(failed, values[tick])
        table = np.zeros(len(frames), LAYOUT)
        for name in ("can_id", "length") if plans else ():
            table[name] = np.concatenate([getattr(plan.rows, name)[: plan.due.size] for plan in plans])
        table["data"], table["at_ns"] = frames, np.repeat(np.array(stamps_ns, np.int64), counts)
        return table

    def _refuse(self, failed: int, values: NDArray[np.float64]) -> None:
        """Name the signal whose value cannot be sent."""
        codec, signal = self._chosen[failed]
        codegen.no_number(codec.name, [(signal, float(values[self._places[failed, P_SOURCE]]))])


class Plan:
    """Which messages are made together, and where each lies among the bytes."""

    def __init__(self, due: Sequence[int], codecs: Sequence[MessageCodec], frames: NDArray[np.uint8]) -> None:
        width = frames.shape[1]
        self.due = np.array(due, np.int64)
        self.rows = Rows(
            np.array([codec.can_id for codec in codecs], np.uint32),
            np.array([codec.length for codec in codecs], np.uint8),
            frames,
        )
        self.cuts = [
            (codec.can_id, row * width, row * width + codec.length) for row, codec in enumerate(codecs)
        ]


def _numbers(codec: MessageCodec, signal: Signal, factor: float) -> tuple[float, ...]:
    if signal.is_float or signal.length > MOST_BITS:
        kind = "a float" if signal.is_float else f"an integer of {signal.length} bits"
        raise ValueError(
            f"{codec.name}.{signal.name} is {kind}; what we send cyclically are integers of at most {MOST_BITS} bits"
        )
    absent = math.nan if signal.not_available is None else signal.not_available
    return (factor, signal.offset, signal.scale, *signal.raw_range, absent)


def _data_id(codec: MessageCodec) -> int:
    if codec.protection is None:
        return -1
    profile = codec.profile
    if profile is None or profile.mode != "both":
        raise ValueError(
            f"{codec.name}: frames made together carry E2E profile 1 with both bytes of the data id, or none"
        )
    return profile.data_id


def _resting_frames(messages: Sequence[tuple[MessageCodec, Signals]]) -> NDArray[np.uint8]:
    """One row per message, of a classic frame at least: the bits of the signals that are not sent."""
    rows = np.zeros((len(messages), max(CLASSIC, *(codec.length for codec, _ in messages))), np.uint8)
    for row, (codec, signals) in zip(rows, messages, strict=True):
        for signal in codec.layout:
            if signal.name not in signals:
                place = np.array((-1, signal.first_bit, signal.length, signal.big_endian), np.int64)
                put_bits(row, resting(signal), place)
    return rows


@compiled
def pack_frames(
    due: NDArray[np.int64],
    values: NDArray[np.float64],
    messages: NDArray[np.int64],
    places: NDArray[np.int64],
    numbers: NDArray[np.float64],
    resting_frames: NDArray[np.uint8],
    counters: NDArray[np.int64],
    frames: NDArray[np.uint8],
) -> int:
    """Frames of the messages `due` into the first rows of `frames`; -1, or the signal whose NaN has no code."""
    for row in range(due.size):
        number, frame = due[row], frames[row]
        message = messages[number]
        for k in range(frame.size):
            frame[k] = resting_frames[number, k]
        for k in range(message[M_FIRST], message[M_LAST]):
            raw = raw_value(values[places[k, P_SOURCE]], numbers[k])
            if math.isnan(raw):
                return k
            put_bits(frame, int(raw), places[k])
        if message[M_DATA_ID] >= 0:
            # order matters: the CRC covers the counter
            frame[1] = frame[1] & 0xF0 | counters[number]
            counters[number] = (counters[number] + 1) % COUNTERS
            frame[0] = checksum(frame[1 : message[M_LENGTH]], message[M_DATA_ID])
    return -1


@compiled
def pack_rows(
    starts: NDArray[np.int64],
    due: NDArray[np.int64],
    values: NDArray[np.float64],
    messages: NDArray[np.int64],
    places: NDArray[np.int64],
    numbers: NDArray[np.float64],
    resting_frames: NDArray[np.uint8],
    counters: NDArray[np.int64],
    frames: NDArray[np.uint8],
) -> tuple[int, int]:
    """The frames of each row of values, those of row k from starts[k] on; (-1, -1), or the row and what `pack_frames` says of it."""
    for k in range(values.shape[0]):
        mine = slice(starts[k], starts[k + 1])
        failed = pack_frames(
            due[mine], values[k], messages, places, numbers, resting_frames, counters, frames[mine]
        )
        if failed >= 0:
            return k, failed
    return -1, -1


@compiled
def raw_value(value: float, numbers: NDArray[np.float64]) -> float:
    """The raw number of an SI value, saturated to the range; of NaN the signal's "not available", if it has one."""
    x = (value / numbers[N_FACTOR] - numbers[N_OFFSET]) / numbers[N_SCALE]
    if x <= numbers[N_LOWEST]:
        return numbers[N_LOWEST]
    if x >= numbers[N_HIGHEST]:
        return numbers[N_HIGHEST]
    # rint rounds halves to even, as Python's round in `Binding` does
    return numbers[N_ABSENT] if math.isnan(x) else np.rint(x)


@compiled
def put_bits(frame: NDArray[np.uint8], raw: int, place: NDArray[np.int64]) -> None:
    """Set the bits of `raw` where they are 1; they are 0 before."""
    last = place[P_FIRST_BIT] + place[P_BITS] - 1
    for k in range(place[P_BITS]):
        if raw >> k & 1:
            if place[P_BIG_ENDIAN]:
                at = last - k
                frame[at >> 3] |= 0x80 >> (at & 7)
            else:
                at = place[P_FIRST_BIT] + k
                frame[at >> 3] |= 1 << (at & 7)


@compiled
def checksum(payload: NDArray[np.uint8], data_id: int) -> int:
    """CRC of E2E profile 1 with both bytes of the data id."""
    # low byte of the data id first, then the high one, then the payload (PRS_E2EProtocol, profile 1, BOTH)
    crc = CRC_TABLE[CRC_TABLE[data_id & 0xFF] ^ data_id >> 8]
    for byte in payload:
        crc = CRC_TABLE[crc ^ byte]
    return crc
