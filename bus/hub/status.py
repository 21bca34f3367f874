"""What the hub says about itself and its clients when asked."""

from dataclasses import asdict, dataclass
from typing import Any, Self


@dataclass(frozen=True, slots=True, kw_only=True)
class ClientStatus:
    """One client as the hub sees it; counts are frames.

    sent: taken from it; delivered: given to it; dropped: lost for it, because it read too slowly;
    backlog: held by the hub for it now; waiting: taken from it, not yet carried by the modelled wire;
    malformed: refused from it.
    """

    name: str
    pid: int
    sent: int
    delivered: int
    dropped: int
    backlog: int
    waiting: int
    malformed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class HubStatus:
    """The hub since it was started; busy_s: how long the modelled wire carried frames."""

    frames: int
    uptime_s: float
    bit_rate: int | None
    busy_s: float
    clients: tuple[ClientStatus, ...]

    def to_message(self) -> dict[str, Any]:
        """As a control message."""
        return {"status": asdict(self)}

    @classmethod
    def from_message(cls, message: dict[str, Any]) -> Self:
        """From a control message."""
        status = dict(message["status"])
        status["clients"] = tuple(ClientStatus(**client) for client in status["clients"])
        return cls(**status)
