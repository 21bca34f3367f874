"""Faults of a node: a babbling one, which sends without end, and one whose controller is bus-off."""

import random
from collections.abc import Sequence
from dataclasses import dataclass

from bus.frame import EXTENDED, EXTENDED_MASK, STANDARD_MASK, Frame
from configuration import CheckedTable
from dbc.database import MessageCodec
from hil.faults.passage import SIDES, Action, Effect, Planned, Selection, Side

US = 1_000
MOST_AT_ONCE = 64
"""Frames that one call gives at most, so that a late caller is not flooded with the frames that it missed."""


@dataclass(frozen=True, slots=True)
class Babble:
    """A node sends frames of random bytes under one identifier."""

    side: Side
    can_id: int
    interval_ns: int  # between frames
    length: int  # data bytes

    def effect(self, generator: random.Random) -> Effect:
        return _Babbling(self, generator)


class _Babbling(Effect):
    def __init__(self, settings: Babble, generator: random.Random) -> None:
        self._settings, self._generator = settings, generator
        self._next_ns: int | None = None

    def begin(self, now_ns: int) -> None:
        self._next_ns = now_ns

    def due(self, now_ns: int) -> Sequence[tuple[Side, Frame]]:
        settings, next_ns = self._settings, self._next_ns
        if next_ns is None or next_ns > now_ns:
            return ()
        count = (now_ns - next_ns) // settings.interval_ns + 1
        # also over the frames beyond MOST_AT_ONCE: they are lost, the rate of the following ones stays
        self._next_ns = next_ns + count * settings.interval_ns
        return [
            (settings.side, Frame(settings.can_id, self._generator.randbytes(settings.length)))
            for _ in range(min(count, MOST_AT_ONCE))
        ]

    def next_ns(self) -> int | None:
        return self._next_ns

    def end(self) -> Sequence[tuple[Side, Frame]]:
        self._next_ns = None
        return ()


@dataclass(frozen=True, slots=True)
class BusOff:
    """The controller of a node is off the bus. With two nodes on the bus, no frame passes in either direction."""

    node: Side

    def effect(self, generator: random.Random) -> Effect:
        return _Silence(self.node)


class _Silence(Effect):
    def __init__(self, node: Side) -> None:
        self.begins_with = (Action("bus_off", node),)
        self.ends_with = (Action("bus_on", node),)

    def passed(self, planned: Planned, side: Side, codec: MessageCodec | None) -> Sequence[Planned]:
        return ()


def read_side(table: CheckedTable, key: str) -> Side:
    """One of the two sides."""
    name = table.text(key)
    for side in SIDES:
        if name == side:
            return side
    raise table.error(key, f"= {name!r} is not one of {', '.join(SIDES)}")


def read_babble(table: CheckedTable, selection: Selection) -> Babble:
    """kind = "babble"; without an identifier 0, which wins every arbitration."""
    if len(selection.codecs) > 1:
        names = ", ".join(codec.name for codec in selection.codecs)
        raise table.error("message", f"means {names}: a babbling node has one identifier")
    return Babble(
        side=selection.side or "plant",
        can_id=selection.codecs[0].can_id if selection.codecs else _identifier(table),
        interval_ns=round(table.number("interval_us", unit="us", low=50.0, high=1e6, default=250.0) * US),
        length=table.integer("length", low=0, high=8, default=8),
    )


def read_bus_off(table: CheckedTable) -> BusOff:
    """kind = "bus_off"."""
    return BusOff(read_side(table, "node"))


def _identifier(table: CheckedTable) -> int:
    if table.flag("extended", default=False):
        return EXTENDED | table.integer("identifier", low=0, high=EXTENDED_MASK, default=0)
    return table.integer("identifier", low=0, high=STANDARD_MASK, default=0)
