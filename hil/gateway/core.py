"""The gateway without its sockets: frames and stamps in, queues of frames for either bus out.

Nothing here waits. A frame that may cross goes into the queue of the other side's bus; the shell sends
from there as fast as that bus accepts it. A finding is reported once per identifier and kind, and counted
from then on.
"""

import heapq
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from bus.frame import Frame
from hil.gateway.findings import Finding
from hil.gateway.injection import Action, Injector
from hil.gateway.routes import KNOWN_LIMIT, OTHER, SIDES, Fate, Routes, Side
from hil.gateway.watcher import Watcher

QUEUE_FRAMES: Final = 4096
"""Frames that may wait for one bus: a second of a full 500 kbit/s bus."""
_REPORTED_STATES: Final = frozenset({Fate.WRONG_SIDE, Fate.UNKNOWN, Fate.BLOCKED})
"""Fates that are reported as a finding."""


@dataclass(slots=True)
class Counts:
    """Counters of one side: frames received from its bus and sent to it."""

    received: int = 0  # from this bus
    stayed: Counter[Fate] = field(default_factory=Counter)  # did not cross, by reason
    sent: int = 0  # onto this bus
    overflowed: int = 0  # lost because this bus did not accept them in time
    held: int = 0  # how often this bus accepted no frame
    silenced: int = 0  # lost while the controller was bus-off by an injected fault
    injected: int = 0  # made by the fault injector


class GatewayCore:
    """Routes frames between two sides."""

    def __init__(
        self,
        routes: Routes,
        *,
        injector: Injector | None = None,
        watcher: Watcher | None = None,
        queue_frames: int = QUEUE_FRAMES,
    ) -> None:
        """queue_frames: that may wait for one bus; the same bound holds for frames that an injector delays."""
        self.routes = routes
        self.counts: dict[Side, Counts] = {side: Counts() for side in SIDES}
        self._injector = injector
        self._watcher = watcher
        self._queue_frames = queue_frames
        self._queues: dict[Side, deque[Frame]] = {side: deque() for side in SIDES}
        self._planned: list[tuple[int, int, Side, Frame]] = []
        self._order = 0  # frames planned for one moment keep their order
        self._bus_off: set[Side] = set()
        self.started_ns: int | None = None
        self._reported: set[tuple[Side, int, str]] = set()
        self._findings: list[Finding] = []

    def start(self, now_ns: int) -> None:
        """Start the run: scripted faults count their times from `now_ns`."""
        self.started_ns = now_ns
        if self._injector is not None:
            self._injector.start(now_ns)

    def receive(self, side: Side, frames: Sequence[Frame], now_ns: int) -> None:
        """Take frames received from the bus of `side`."""
        counts, queue, fate_of = self.counts[side], self._queues[OTHER[side]], self.routes.fate
        counts.received += len(frames)
        if side in self._bus_off:
            counts.silenced += len(frames)
            return
        watcher = self._watcher
        for frame in frames:
            fate = fate_of(side, frame.can_id)
            # before faults are injected: what the watcher finds is the sender's doing, not the injector's
            if watcher is not None and fate is Fate.PASS:
                watcher.receive(side, frame, now_ns)
            if fate is not Fate.PASS:
                counts.stayed[fate] += 1
                if fate in _REPORTED_STATES:
                    self._report(side, frame.can_id, fate.value, now_ns)
            elif self._injector is None:
                queue.append(frame)
            else:
                self._plan(self._injector, side, frame, now_ns)
        self._bound(OTHER[side], now_ns)

    def nothing_came(self, side: Side, now_ns: int) -> None:
        """The receive queue of `side` is empty: a missing message is now known to be missing, not just unread."""
        if self._watcher is not None:
            self._watcher.look(side, now_ns)

    def _plan(self, injector: Injector, side: Side, frame: Frame, now_ns: int) -> None:
        """Queue the frames that the injector gives in place of `frame`, now or later."""
        for at_ns, changed in injector.pass_frame(side, frame, now_ns):
            if at_ns <= now_ns:
                self._queues[OTHER[side]].append(changed)
            elif len(self._planned) < self._queue_frames:
                heapq.heappush(self._planned, (at_ns, self._order, OTHER[side], changed))
                self._order += 1
            else:
                self._lose(OTHER[side], changed, now_ns)

    def advance(self, now_ns: int) -> list[Action]:
        """Queue the frames that are due by now; returns the injector's actions that the shell has to carry out."""
        while self._planned and self._planned[0][0] <= now_ns:
            _, _, side, frame = heapq.heappop(self._planned)
            self._queues[side].append(frame)
            self._bound(side, now_ns)
        if self._injector is None:
            return []
        for side, frame in self._injector.spontaneous(now_ns):
            self._queues[side].append(frame)
            self.counts[side].injected += 1
            self._bound(side, now_ns)
        return [action for action in self._injector.actions(now_ns) if not self._switch_bus(action)]

    def _switch_bus(self, action: Action) -> bool:
        """Carry out bus_off and bus_on; returns whether the action was one of them."""
        sides = [side for side in SIDES if side == action.target]
        if action.kind == "bus_off":
            self._bus_off.update(sides)
            for side in sides:
                self.counts[side].silenced += len(self._queues[side])
                self._queues[side].clear()
        elif action.kind == "bus_on":
            self._bus_off.difference_update(sides)
        return action.kind in ("bus_off", "bus_on")

    def next_ns(self) -> int | None:
        """When `advance` has something to do next; None while nothing is planned or watched."""
        planned = self._planned[0][0] if self._planned else None
        injected = self._injector.next_ns() if self._injector is not None else None
        looking = self._watcher.next_ns() if self._watcher is not None else None
        known = [at_ns for at_ns in (planned, injected, looking) if at_ns is not None]
        return min(known, default=None)

    def waiting(self, side: Side) -> deque[Frame]:
        """Frames for the bus of `side`, oldest first; the shell removes what that bus has taken."""
        if side in self._bus_off and self._queues[side]:
            self.counts[side].silenced += len(self._queues[side])
            self._queues[side].clear()
        return self._queues[side]

    def findings(self) -> list[Finding]:
        """What was found since the last call."""
        found, self._findings = self._findings, []
        return found if self._watcher is None else found + self._watcher.findings()

    def _bound(self, side: Side, now_ns: int) -> None:
        queue = self._queues[side]
        # the oldest is lost: a control loop has more use for the newest values
        while len(queue) > self._queue_frames:
            self._lose(side, queue.popleft(), now_ns)

    def _lose(self, side: Side, frame: Frame, now_ns: int) -> None:
        self.counts[side].overflowed += 1
        self._report(
            side, frame.can_id, f"lost: more than {self._queue_frames} frames wait for this bus", now_ns
        )

    def _report(self, side: Side, can_id: int, what: str, now_ns: int) -> None:
        key = (side, can_id, what)
        if key in self._reported or len(self._reported) >= KNOWN_LIMIT:
            return
        self._reported.add(key)
        codec = self.routes.database.match(can_id)
        self._findings.append(Finding(side, can_id, codec.name if codec else "", what, now_ns))
