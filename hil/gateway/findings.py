"""The finding of a gateway: a value that its shell logs, once or on a change."""

from dataclasses import dataclass

from bus.frame import EXTENDED
from hil.gateway.routes import Side


@dataclass(frozen=True, slots=True)
class Finding:
    """Something unexpected about a message."""

    side: Side
    can_id: int
    name: str  # of the message; empty if the DBC does not know it
    what: str
    at_ns: int  # CLOCK_MONOTONIC [ns]

    def __str__(self) -> str:
        width = 8 if self.can_id & EXTENDED else 3
        return f"{self.side} side: {self.name or 'unknown'} {self.can_id & ~EXTENDED:0{width}X}: {self.what}"
