"""The end-to-end check of everything that crosses: a watch per message, on the side it comes from.

The gateway judges the frames that it receives, before any fault is injected, and passes broken ones on: the
receiver decides what to do about them. So the gateway's findings concern the senders and the
buses, and a receiver's findings beyond them concern the gateway.
"""

from collections import Counter
from typing import Final

from bus.frame import Frame
from dbc.watch import State, Trouble, Watch
from hil.gateway.findings import Finding
from hil.gateway.routes import SIDES, Routes, Side

LOOK_NS: Final = 10_000_000
"""Interval at which messages that have fallen silent are looked for [ns]."""
QUIET_NS: Final = 1_000_000_000
"""Shortest time between two reports about a message that alternates between valid and invalid [ns]."""
_REPORTED_STATES: Final = frozenset({State.VALID, State.INVALID})


class Watcher:
    """Watches the messages that cross from either side."""

    def __init__(self, routes: Routes) -> None:
        self._watches: dict[Side, dict[int, Watch]] = {
            side: {codec.can_id: Watch(codec) for codec in routes.crossing(side)} for side in SIDES
        }
        self._reported: set[tuple[Side, int, Trouble]] = set()
        self._findings: list[Finding] = []
        self._look_ns: dict[Side, int] = {}
        self._reported_ns: dict[tuple[Side, int], int] = {}

    def receive(self, side: Side, frame: Frame, now_ns: int) -> None:
        """Judge a frame by its bus' stamp, or by `now_ns` where it has none."""
        watch = self._watches[side].get(frame.can_id)
        if watch is None:
            return
        # from the first frame on: before it nobody is expected to send
        self._look_ns.setdefault(side, now_ns + LOOK_NS)
        before = watch.state
        trouble = watch.receive(frame.data, frame.at_ns or now_ns)
        if trouble is not None or watch.state is not before:
            self._note(side, watch, trouble, before, now_ns)

    def look(self, side: Side, now_ns: int) -> None:
        """Find messages that have fallen silent by now. Call it when everything that `side` sent has been received."""
        if now_ns < self._look_ns.get(side, now_ns + 1):
            return
        self._look_ns[side] = now_ns + LOOK_NS
        for watch in self._watches[side].values():
            before = watch.state
            trouble = watch.overdue(now_ns)
            if trouble is not None:
                self._note(side, watch, trouble, before, now_ns)

    def next_ns(self) -> int | None:
        """When to look next; None before the first frame."""
        return min(self._look_ns.values(), default=None)

    def _note(self, side: Side, watch: Watch, trouble: Trouble | None, before: State, now_ns: int) -> None:
        """Report each trouble of a message once, and each change between valid and invalid."""
        can_id, name = watch.codec.can_id, watch.codec.name
        if trouble is not None and (side, can_id, trouble) not in self._reported:
            self._reported.add((side, can_id, trouble))
            claimed = f" ({watch.claimed})" if trouble is Trouble.MASQUERADED else ""
            self._findings.append(Finding(side, can_id, name, f"{trouble.value}{claimed}", now_ns))
        # a message that starts (INIT to VALID) is no finding
        changed = watch.state is not before and {watch.state, before} == _REPORTED_STATES
        if changed and now_ns >= self._reported_ns.get((side, can_id), now_ns):
            self._reported_ns[side, can_id] = now_ns + QUIET_NS
            self._findings.append(Finding(side, can_id, name, f"is {watch.state.value}", now_ns))

    def findings(self) -> list[Finding]:
        """What was found since the last call."""
        found, self._findings = self._findings, []
        return found

    def troubles(self, side: Side) -> Counter[tuple[str, Trouble]]:
        """How often each trouble struck each message that comes from `side`: (message, trouble)."""
        return Counter(
            {
                (watch.codec.name, trouble): count
                for watch in self._watches[side].values()
                for trouble, count in watch.counts.items()
            }
        )
