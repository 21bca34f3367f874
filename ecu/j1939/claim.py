"""Claiming the ECU's source address (J1939-81), without clock or bus.

The DBC fixes the ECU's identifiers, and with them its address. So the ECU cannot take another one: it either has this
address or sends nothing. The machine then falls back to its safe limits, as it does whenever the ECU is silent.
"""

import enum
from collections.abc import Callable
from typing import Final

from bus.frame import ERROR, EXTENDED, FD, REMOTE, Frame
from dbc.j1939 import pgn, source_address

ADDRESS_CLAIMED: Final = 0xEE00
GLOBAL: Final = 0xFF
NULL: Final = 0xFE
"""Source address of a controller that has none."""
CONTENTION_NS: Final = 250_000_000
"""How long others have to object to a claim of one of CONTENDED; any other address may be used at once."""
CONTENDED: Final = range(128, 248)
DELAY_NS: Final = 600_000
"""Unit of the random delay, 0 to 255 of them, after which a controller says that it has no address: two would collide."""


def contention_ns(address: int) -> int:
    """How long a claim of this address is open to objections."""
    return CONTENTION_NS if address in CONTENDED else 0


class State(enum.Enum):
    """Of an address."""

    SILENT = enum.auto()
    CLAIMING = enum.auto()
    OWNED = enum.auto()
    LOST = enum.auto()


class AddressClaim:
    """One controller's claim of one address."""

    def __init__(self, name: int, address: int, random: Callable[[], int]) -> None:
        """random: gives 0 to 255."""
        self.name, self.address = name, address
        self._random = random
        self._due_ns: int | None = None
        self.state = State.SILENT
        self.lost_to: int | None = None  # the NAME that has the address instead

    def start(self, now_ns: int) -> list[Frame]:
        """Claim the address."""
        self.state = State.CLAIMING
        self._due_ns = now_ns + contention_ns(self.address)
        return [self._claimed(self.address)]

    def receive(self, frame: Frame, now_ns: int) -> list[Frame]:
        """Answer a claim of the same address by another controller: by ours if our NAME is lower, else the address is lost."""
        if not is_message(frame, ADDRESS_CLAIMED) or len(frame.data) != 8:
            return []
        if source_address(frame.can_id) != self.address or self.state not in (State.CLAIMING, State.OWNED):
            return []
        other = int.from_bytes(frame.data, "little")
        if self.name < other:
            return [self._claimed(self.address)]
        self.state, self.lost_to = State.LOST, other
        self._say_so_later(now_ns)
        return []

    def requested(self, now_ns: int) -> list[Frame]:
        """Somebody asks who has which address."""
        if self.state in (State.CLAIMING, State.OWNED):
            return [self._claimed(self.address)]
        if self.state is State.LOST:
            self._say_so_later(now_ns)
        return []

    def pending(self, now_ns: int) -> list[Frame]:
        """What is due by now: the end of the time for objections, or the statement that this controller has no address."""
        if self._due_ns is None or now_ns < self._due_ns:
            return []
        self._due_ns = None
        if self.state is State.LOST:
            return [self._claimed(NULL)]
        self.state = State.OWNED
        return []

    def _say_so_later(self, now_ns: int) -> None:
        """The statement that this controller has no address becomes due."""
        self._due_ns = now_ns + DELAY_NS * self._random()

    def _claimed(self, address: int) -> Frame:
        return message(ADDRESS_CLAIMED, address, self.name.to_bytes(8, "little"))


def message(group: int, source: int, data: bytes, *, to: int = GLOBAL, priority: int = 6) -> Frame:
    """A frame of a parameter group with a destination."""
    return Frame(EXTENDED | priority << 26 | group << 8 | to << 8 | source, data)


def is_message(frame: Frame, group: int) -> bool:
    """Whether a frame is a classic data frame of this parameter group."""
    return (
        bool(frame.can_id & EXTENDED)
        and not frame.can_id & (REMOTE | ERROR)
        and not frame.flags & FD
        and pgn(frame.can_id) == group
    )
