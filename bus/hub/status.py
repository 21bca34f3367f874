"""Counters of the hub and of its clients, as `loaderhil hub --status` prints them."""

from dataclasses import asdict, dataclass
from typing import Any, Self


@dataclass(frozen=True, slots=True, kw_only=True)
class ClientStatus:
    """One client as the hub sees it; counts are frames."""

    name: str
    pid: int  # 0 if it lives in another namespace
    sent: int  # taken from the client
    delivered: int  # given to the client
    dropped: int  # lost for the client, because it read too slowly
    backlog: int  # held by the hub for the client now
    waiting: int  # taken from the client, not yet carried by the modelled wire
    malformed: int  # refused from the client


@dataclass(frozen=True, slots=True, kw_only=True)
class HubStatus:
    """The hub since it was started."""

    frames: int  # relayed
    uptime_s: float  # [s]
    bit_rate: int | None  # of the modelled wire [bit/s]; None: frames are relayed at once
    busy_s: float  # how long the modelled wire carried frames [s]
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
