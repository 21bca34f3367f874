"""The interface of every bus: SocketCAN, the hub, and the virtual bus inside one process."""

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from bus.errors import BusFinding
from bus.frame import Frame
from bus.user_error import UserError


class BusClosed(ConnectionError):
    """The bus is gone: the hub ended, the interface went away, or `close` was called."""


class BusUnavailable(UserError, ConnectionError):
    """The bus cannot be opened; the message says what is missing and what would help."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """Counters since the transport was opened; frames unless said otherwise."""

    received: int = 0  # given out by `drain`
    sent: int = 0  # accepted by the bus; says nothing about other nodes having received them
    dropped_in: int = 0  # lost before we could read them (receive buffer full)
    dropped_out: int = 0  # not accepted for sending (send buffer full)
    errors: int = 0  # error frames


class Transport(Protocol):
    """A connection to one bus; none of its methods blocks."""

    def send(self, frame: Frame) -> bool:
        """Hand one frame to the bus. False: not accepted, and counted in `dropped_out`.

        Raises BusClosed when the bus is gone.
        """

    def drain(self, limit: int = 64) -> list[Frame]:
        """At most `limit` frames that have arrived, oldest first; [] if there are none.

        Raises BusClosed when the bus is gone and everything that arrived has been read.
        """

    def findings(self) -> list[BusFinding]:
        """Findings from error frames and from the interface since the last call, as far as `drain` has reached."""

    def fileno(self) -> int:
        """A file descriptor that is readable when `drain` has something to give."""

    def statistics(self) -> Statistics:
        """Counters since opening."""

    def close(self) -> None:
        """Release the bus; a second call does nothing."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None: ...
