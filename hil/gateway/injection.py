"""The interface between the gateway and a fault injector.

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
    """Decides which frames are sent in place of each one. Before `start` it only obeys commands."""

    def start(self, now_ns: int) -> None:
        """Start the run: times of a script count from `now_ns`."""

    def pass_frame(self, side_from: Side, frame: Frame, now_ns: int) -> Sequence[Planned]:
        """The frames to send in place of `frame`, which came from `side_from` and is routed to the other side.

        () drops it; (Planned(now_ns, frame),) passes it untouched.
        """

    def spontaneous(self, now_ns: int) -> Sequence[tuple[Side, Frame]]:
        """Frames made by faults that are due by now: (side onto whose bus they go, frame)."""

    def next_ns(self) -> int | None:
        """When `spontaneous` or `actions` will next have something; None while nothing is planned."""

    def actions(self, now_ns: int) -> Sequence[Action]:
        """Actions that are due by now; each is given once."""

    def command(self, request: Mapping[str, Any], now_ns: int) -> Mapping[str, Any]:
        """Obey a live command; returns its answer."""
