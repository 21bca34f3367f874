"""The modelled bus of `bus.wire` for frames as rows: the same order and stamps, in one compiled call for each side's turn."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from bus.arbitration import priority
from bus.cache_folder import digest_of
from bus.frame import EXTENDED, Frame
from bus.machine_code import UNCOUNTED, code_folder, compiler, direct, translatable
from bus.rows import LAYOUT, Rows, columns_of, frames_of
from bus.wire import SECOND, wire_bits

_FOLDER: Final = Path(__file__).resolve().parent
_compiled = compiler(code_folder(_FOLDER, "bus", digest_of(sorted(_FOLDER.glob("*.py")))), **UNCOUNTED)

translatable(**UNCOUNTED)(priority)  # Python for all others, compiled into `carry`

ROOM: Final = 64
"""Rows that a table has at first; one that is full is made twice as long."""

PLANT, ECU = range(2)
"""Who sent a frame."""
# Places in the numbers that are carried from call to call: rows of each table, and when the wire is free [ns].
PENDING, BUS, TO_ECU, TO_PLANT, FREE = range(5)


@runtime_checkable
class RowPlant(Protocol):
    """A plant that gives its frames as rows, which costs less than an object for each."""

    @property
    def wanted(self) -> frozenset[int]:
        """Identifiers of the frames that its `receive` looks at."""
        ...

    def tick_rows(self, now_ns: int) -> tuple[Rows, int]:
        """One tick: rows that hold until the next one, and how many of them are frames."""
        ...

    def reference_rows(self, truths: Sequence[Any], first: int, at_ns: int) -> NDArray[np.void]:
        """A table of LAYOUT: frames of the test instrumentation at ticks at which this was true; number and stamp of the first of them."""
        ...


@runtime_checkable
class RowEcu(Protocol):
    """An ECU that takes and gives frames as rows."""

    def cycle_rows(self, received: NDArray[np.void], now_ns: int) -> tuple[Rows, int, Sequence[Any]]:
        """Receive the frames of a table of LAYOUT, each at its stamp, then one cycle: rows, how many of them are frames, and findings."""
        ...


class Stamped(NamedTuple):
    """The columns of a table of LAYOUT."""

    at_ns: NDArray[np.int64]
    rows: Rows


class Tables(NamedTuple):
    """What `carry` works on."""

    # frames that wait for the wire, by priority
    pending: Rows
    priority: NDArray[np.int64]
    sender: NDArray[np.uint8]
    bus: Stamped  # everything that has arrived
    to_ecu: Stamped
    to_plant: Stamped  # what the plant looks at
    counts: NDArray[np.int64]  # by the places above
    duration: NDArray[np.int64]  # (2, 9) of a frame with 11 and 29 bits of identifier, by its length [ns]
    wanted: NDArray[np.uint32]  # identifiers that the plant looks at


class RowWire:
    """A wire between plant and ECU, and the frames that have arrived: all of them, those for the ECU, and those for the plant."""

    def __init__(self, wanted: frozenset[int], bit_rate: int = 500_000) -> None:
        """wanted: identifiers of the frames that the plant looks at; those of other frames of the ECU are recorded only."""
        sizes = [[Frame(kind, bytes(length)) for length in range(9)] for kind in (0, EXTENDED)]
        duration = [[round(wire_bits(frame) * (SECOND / bit_rate)) for frame in same] for same in sizes]
        self._duration = np.array(duration, np.int64)
        self._wanted = np.array(sorted(wanted), np.uint32)
        self._counts = np.zeros(5, np.int64)
        self._priority, self._sender = np.zeros(0, np.int64), np.zeros(0, np.uint8)
        self._pending, self._bus, self._to_ecu, self._to_plant = (np.zeros(0, LAYOUT) for _ in range(4))
        self._grow()
        self._carry: dict[int, Callable[..., bool]] = {}  # by sender, as each has tables of its own kind

    def carry(self, sent: Rows, count: int, sender: int, now_ns: int, until_ns: int) -> None:
        """Queue the first `count` rows at `now_ns`, then let everything arrive that does by `until_ns`.

        sent: of one sender always columns of the same kind of table, of two rows at least, whatever their number.
        """
        arguments = sent, count, sender, now_ns, until_ns
        if sender not in self._carry:
            self._carry[sender] = direct(carry, *arguments, self._tables)
        while not self._carry[sender](*arguments, self._tables):
            self._grow()

    def take_bus(self) -> NDArray[np.void]:
        """Every frame that has arrived since the last call, in order: a table of LAYOUT of its own."""
        count, self._counts[BUS] = self._counts[BUS], 0
        return self._bus[:count].copy()

    def take_to_plant(self) -> list[Frame]:
        """Those that the plant looks at."""
        count, self._counts[TO_PLANT] = self._counts[TO_PLANT], 0
        return frames_of(self._to_plant[:count]) if count else []

    def take_to_ecu(self) -> NDArray[np.void]:
        """Those for the ECU, as a table of LAYOUT that the next `carry` fills anew."""
        count, self._counts[TO_ECU] = self._counts[TO_ECU], 0
        return self._to_ecu[:count]

    def _grow(self) -> None:
        """Give every table twice its room."""
        room = max(ROOM, 2 * len(self._pending))

        self._priority, self._sender = _longer(self._priority, room), _longer(self._sender, room)
        self._pending, self._bus = _longer(self._pending, room), _longer(self._bus, room)
        self._to_ecu, self._to_plant = _longer(self._to_ecu, room), _longer(self._to_plant, room)
        bus, to_ecu, to_plant = (
            Stamped(table["at_ns"], columns_of(table)) for table in (self._bus, self._to_ecu, self._to_plant)
        )
        self._tables = Tables(
            columns_of(self._pending),
            self._priority,
            self._sender,
            bus,
            to_ecu,
            to_plant,
            self._counts,
            self._duration,
            self._wanted,
        )


def _longer(table: NDArray[Any], room: int) -> NDArray[Any]:
    made = np.zeros(room, table.dtype)
    made[: len(table)] = table
    return made


@_compiled
def carry(sent: Rows, count: int, sender: int, now_ns: int, until_ns: int, t: Tables) -> bool:
    """See `RowWire.carry`. False, and nothing is done, if a table has no room for all frames that wait."""
    counts, pending = t.counts, t.counts[PENDING]
    most = pending + count + max(counts[BUS], counts[TO_ECU], counts[TO_PLANT])
    if most > t.priority.size:
        return False
    for k in range(count):
        first, at = priority(int(sent.can_id[k])), pending
        while at > 0 and t.priority[at - 1] > first:  # behind its equals, which keep their order
            _copy(t.pending, at - 1, t.pending, at)
            t.priority[at], t.sender[at] = t.priority[at - 1], t.sender[at - 1]
            at -= 1
        _copy(sent, k, t.pending, at)
        t.priority[at], t.sender[at] = first, sender
        pending += 1

    free, arrived = max(counts[FREE], now_ns), 0
    while arrived < pending:
        can_id = int(t.pending.can_id[arrived])
        end = free + t.duration[1 if can_id & EXTENDED else 0, t.pending.length[arrived]]
        if end > until_ns:
            break
        free = end
        _arrive(t, arrived, free, t.bus, BUS)
        if t.sender[arrived] == PLANT:
            _arrive(t, arrived, free, t.to_ecu, TO_ECU)
        else:
            for wanted in t.wanted:
                if can_id == wanted:
                    _arrive(t, arrived, free, t.to_plant, TO_PLANT)
        arrived += 1
    for k in range(arrived, pending):
        _copy(t.pending, k, t.pending, k - arrived)
        t.priority[k - arrived], t.sender[k - arrived] = t.priority[k], t.sender[k]
    counts[PENDING], counts[FREE] = pending - arrived, free
    return True


@_compiled
def _arrive(t: Tables, which: int, at_ns: int, there: Stamped, place: int) -> None:
    row = t.counts[place]
    there.at_ns[row] = at_ns
    _copy(t.pending, which, there.rows, row)
    t.counts[place] = row + 1


@_compiled
def _copy(source: Rows, one: int, target: Rows, other: int) -> None:
    target.can_id[other], target.length[other] = source.can_id[one], source.length[one]
    for k in range(8):
        target.data[other, k] = source.data[one, k]
