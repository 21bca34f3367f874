"""What the gateway asks of whoever injects faults, and what it gets back.

The gateway calls in the order of time, from one thread, with stamps of the monotonic clock [ns]. An
injector owns no clock and does no I/O, so that the same script gives the same faults in lockstep.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from bus.frame import Frame
from hil.faults.passage import Action, Planned
from hil.gateway.routes import Side

__all__ = ["Action", "Injector", "Planned"]


class Injector(Protocol):
    """Decides what becomes of each frame. Before `start` it has nothing scripted to do, and obeys commands."""

    def start(self, now_ns: int) -> None:
        """The run begins: times of a script count from here."""

    def pass_frame(self, side_from: Side, frame: Frame, now_ns: int) -> Sequence[Planned]:
        """What to send in place of `frame`, which came from `side_from` and is routed to the other side.

        () drops it; (Planned(now_ns, frame),) passes it untouched.
        """

    def spontaneous(self, now_ns: int) -> Sequence[tuple[Side, Frame]]:
        """Frames nobody sent that are due by now: (side whose bus they go onto, frame)."""

    def next_ns(self) -> int | None:
        """When `spontaneous` or `actions` will next have something; None while nothing is planned."""

    def actions(self, now_ns: int) -> Sequence[Action]:
        """What is due by now beyond frames; each is given once."""

    def command(self, request: Mapping[str, Any], now_ns: int) -> Mapping[str, Any]:
        """Obey a live command and say what came of it."""
