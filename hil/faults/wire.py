"""The wire of a lockstep run with an injector between the senders and the bus.

Frames that a fault delays compete for the wire when they are due; frames that a fault makes compete
like any other, so a babbling node starves the bus as on a real one. A frame on the wire is never
interrupted. Without faults the stamps are those of `bus.wire.Wire`.
"""

import heapq
from collections import Counter
from collections.abc import Callable, Iterable
from typing import cast

from bus.arbitration import priority
from bus.frame import Frame
from bus.wire import SECOND, wire_bits
from hil.faults.injector import Injector
from hil.faults.passage import OTHER, Action, Side

WAITING_LIMIT = 16
"""Frames of one identifier that wait for the wire: a controller's transmit queue. A full one loses its oldest."""


class FaultyWire:
    """Takes the frames of both senders through the injector, then across one shared wire."""

    def __init__(
        self,
        injector: Injector,
        act: Callable[[Action, int], None] = lambda action, now_ns: None,
        *,
        bit_rate: int = 500_000,
    ) -> None:
        """injector: started. act: does what the injector wants done to a process, at the stamp given."""
        self._injector = injector
        self._act = act
        self._bit_ns = SECOND / bit_rate
        self._requests: list[tuple[int, int, Side, Frame]] = []  # by the time they ask for the wire
        self._waiting: list[tuple[int, int, Side, Frame]] = []  # by priority
        self._priorities: dict[int, int] = {}
        self._depth: Counter[int] = Counter()
        self._order = 0
        self._free_ns = 0
        self.overwritten = 0

    def put(self, frames: Iterable[Frame], now_ns: int, sender: str) -> None:
        """Frames that a side sends at `now_ns`."""
        side = cast("Side", sender)
        self._poll(now_ns)
        for frame in frames:
            for at_ns, passed in self._injector.pass_frame(side, frame, now_ns):
                self._request(at_ns, side, passed)

    def take(self, until_ns: int) -> list[tuple[str, Frame]]:
        """(sender, frame) of what has arrived by `until_ns`, in order, stamped with the arrival."""
        self._poll(until_ns)
        arrived: list[tuple[str, Frame]] = []
        while self._await_frame(until_ns):
            _, _, side, frame = self._waiting[0]
            at_ns = self._free_ns + round(wire_bits(frame) * self._bit_ns)
            if at_ns > until_ns:
                break
            heapq.heappop(self._waiting)
            self._depth[frame.can_id] -= 1
            arrived.append((side, Frame(frame.can_id, frame.data, at_ns, frame.flags)))
            self._free_ns = at_ns
        return arrived

    def _await_frame(self, until_ns: int) -> bool:
        """Whether a frame waits for the wire; an idle time before the next request is skipped."""
        self._admit()
        if not self._waiting and self._requests and self._requests[0][0] <= until_ns:
            # the wire was idle: it is free since then, and the next frame starts when it is requested
            self._free_ns = max(self._free_ns, self._requests[0][0])
            self._admit()
        return bool(self._waiting)

    def _admit(self) -> None:
        """Let the frames that were requested before the wire is free take part in the arbitration."""
        while self._requests and self._requests[0][0] <= self._free_ns:
            _, order, side, frame = heapq.heappop(self._requests)
            # without a bound a babbling node of low priority would queue frames without end
            if self._depth[frame.can_id] >= WAITING_LIMIT:
                self._lose_oldest(frame.can_id)
            self._depth[frame.can_id] += 1
            if frame.can_id not in self._priorities:
                self._priorities[frame.can_id] = priority(frame.can_id)
            heapq.heappush(self._waiting, (self._priorities[frame.can_id], order, side, frame))

    def _lose_oldest(self, can_id: int) -> None:
        oldest = min(
            (entry for entry in self._waiting if entry[3].can_id == can_id), key=lambda entry: entry[1]
        )
        self._waiting.remove(oldest)
        heapq.heapify(self._waiting)
        self._depth[can_id] -= 1
        self.overwritten += 1

    def _poll(self, until_ns: int) -> None:
        """Fetch frames and actions of the injector at the times that it names."""
        while (now_ns := self._injector.next_ns()) is not None and now_ns <= until_ns:
            for to, frame in self._injector.spontaneous(now_ns):
                self._request(now_ns, OTHER[to], frame)
            for action in self._injector.actions(now_ns):
                self._act(action, now_ns)

    def _request(self, at_ns: int, side: Side, frame: Frame) -> None:
        heapq.heappush(self._requests, (at_ns, self._order, side, frame))
        self._order += 1
