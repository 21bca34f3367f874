"""What the gateway finds: values for its shell to log, each reported once or on a change."""

from dataclasses import dataclass

from bus.frame import EXTENDED
from hil.gateway.routes import Side


@dataclass(frozen=True, slots=True)
class Finding:
    """Something odd: on which side, which identifier, what."""

    side: Side
    can_id: int
    name: str
    what: str
    at_ns: int

    def __str__(self) -> str:
        width = 8 if self.can_id & EXTENDED else 3
        return f"{self.side} side: {self.name or 'unknown'} {self.can_id & ~EXTENDED:0{width}X}: {self.what}"
