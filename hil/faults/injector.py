"""Applies the faults of a run: every frame between plant and ECU passes here, in lockstep and in real time.

Pure: frames and stamps in, frames, departures and actions out. No clock; equal faults, seed and calls
give equal answers. A call with an earlier stamp than the last one counts as made at the last one.

Faults act one after the other in the order of their numbers, each on what the ones before it left.
"""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

from bus.frame import Frame
from bus.user_error import UserError
from configuration import CheckedTable
from dbc.database import Database, MessageCodec
from hil.faults.passage import OTHER, Action, Effect, Fault, Planned, Side
from hil.faults.table import SECOND, read_fault

FAULTS_LIMIT = 500
"""Faults of one run, including those that are over: each is kept for the record."""
REMEMBERED = 4096
"""Identifiers whose message is remembered."""


class Phase(Enum):
    """State of a fault; DRAINING: over, but frames that it delayed have not all been sent."""

    WAITING = "waiting"
    ACTIVE = "active"
    DRAINING = "draining"
    OVER = "over"


@dataclass(frozen=True, slots=True)
class FaultEvent:
    """A fault began or ended."""

    at_ns: int  # on the caller's clock
    number: int
    label: str
    what: str  # "begins", "ends" or "cleared"
    struck: int  # frames affected so far: changed, dropped, delayed, or made by the fault


@dataclass(slots=True, eq=False)
class _Running:
    """One fault with its effect, times on the caller's clock."""

    number: int
    fault: Fault
    effect: Effect
    begins_ns: int
    ends_ns: int | None  # None: until it is cleared
    phase: Phase = Phase.WAITING
    struck: int = 0  # frames affected so far
    first_ns: int | None = None  # when it affected the first frame

    def strike(self, at_ns: int, count: int) -> None:
        """Count `count` frames that the fault changed or made."""
        self.struck += count
        if count and self.first_ns is None:
            self.first_ns = at_ns


@dataclass(slots=True)
class _Outbox:
    """Frames and actions that the caller has not fetched yet."""

    frames: list[tuple[Side, Frame]] = field(default_factory=list)
    actions: list[Action] = field(default_factory=list)


class Injector:
    """Faults between two sides. `events` grows as they begin and end."""

    def __init__(self, database: Database, faults: Sequence[Fault] = (), *, seed: int = 0) -> None:
        self._database = database
        self._seed = seed
        self._codecs: dict[int, MessageCodec | None] = {}
        self._scripted = tuple(faults)
        self._running: list[_Running] = []
        self._acting: list[_Running] = []  # active or draining
        self._concerned: dict[tuple[Side, int], list[_Running]] = {}  # of those, by the frames they are about
        self._count = len(self._scripted)  # numbers given; those of the script are taken whenever it starts
        self._now_ns = 0
        self._change_ns: int | None = None  # when the next fault begins or ends
        self._outbox = _Outbox()
        self.events: list[FaultEvent] = []

    def start(self, now_ns: int) -> None:
        """Start the run; the scripted faults count their times from `now_ns`."""
        self._now_ns = now_ns
        for number, fault in enumerate(self._scripted, start=1):
            self._add(number, fault, now_ns)
        self._advance(now_ns)

    def pass_frame(self, side_from: Side, frame: Frame, now_ns: int) -> Sequence[Planned]:
        """The frames to send to the other side in place of `frame`, and when."""
        now_ns = self._advance(now_ns)
        planned: Sequence[Planned] = (Planned(now_ns, frame),)
        # the usual case, and the whole cost of an injector without active faults
        if not self._acting:
            return planned
        concerned = self._concerned.get((side_from, frame.can_id))
        if concerned is None:
            concerned = self._who_is_concerned(side_from, frame.can_id)
        for running in concerned:
            planned = _through(running, planned, side_from, self._codecs[frame.can_id])
        return planned

    def spontaneous(self, now_ns: int) -> list[tuple[Side, Frame]]:
        """Frames that faults send by themselves by `now_ns`, each with the side whose bus it goes onto."""
        now_ns = self._advance(now_ns)
        frames, self._outbox.frames = self._outbox.frames, []
        for running in self._acting:
            if running.phase is Phase.ACTIVE:
                made = running.effect.due(now_ns)
                running.strike(now_ns, len(made))
                frames += made
        return [(OTHER[side_from], frame) for side_from, frame in frames]

    def actions(self, now_ns: int) -> list[Action]:
        """Actions on processes that are due by `now_ns`; each is given once."""
        self._advance(now_ns)
        actions, self._outbox.actions = self._outbox.actions, []
        return actions

    def next_ns(self) -> int | None:
        """When `spontaneous` or `actions` may have something next; None: never, unless a frame or command comes."""
        if self._outbox.frames or self._outbox.actions:
            return self._now_ns
        times = [running.effect.next_ns() for running in self._acting if running.phase is Phase.ACTIVE]
        return min((t for t in (*times, self._change_ns) if t is not None), default=None)

    def finish(self, now_ns: int) -> None:
        """End the run and every fault that is still active."""
        now_ns = self._advance(now_ns)
        for running in self._acting:
            if running.phase is Phase.ACTIVE:
                self._end(running, now_ns, "ends")

    def first_struck_ns(self, number: int) -> int | None:
        """When a fault first affected a frame; None if it has not yet."""
        return next((r.first_ns for r in self._running if r.number == number), None)

    def command(self, request: Mapping[str, object], now_ns: int | None = None) -> dict[str, object]:
        """Obey a live command. The answer has `ok`, and `error` where it is false.

        now_ns: None stands for the stamp of the last call.

        {"command": "inject", "fault": {a [[fault]] table; at_s counts from now}}
        {"command": "list"}
        {"command": "clear", "number": one, or every fault without it}
        """
        now_ns = self._advance(self._now_ns if now_ns is None else now_ns)
        try:
            match request.get("command"):
                case "inject":
                    return self._command_inject(request, now_ns)
                case "list":
                    return {"ok": True, "faults": [_listed(running, now_ns) for running in self._running]}
                case "clear":
                    return self._command_clear(request.get("number"), now_ns)
                case other:
                    return {"ok": False, "error": f"{other!r} is no command; there are inject, list, clear"}
        except UserError as error:
            return {"ok": False, "error": str(error)}

    def _command_inject(self, request: Mapping[str, object], now_ns: int) -> dict[str, object]:
        if self._count >= FAULTS_LIMIT:
            return {
                "ok": False,
                "error": f"this run has had {self._count} faults; it takes at most {FAULTS_LIMIT}",
            }
        table = CheckedTable(request, file="inject").table("fault")
        fault = read_fault(table, self._database)
        self._count += 1
        running = self._add(self._count, fault, now_ns)
        self._advance(now_ns)
        return {"ok": True, "number": running.number, "fault": running.fault.label}

    def _command_clear(self, number: object, now_ns: int) -> dict[str, object]:
        live = [r for r in self._running if r.phase in (Phase.WAITING, Phase.ACTIVE)]
        chosen = [r for r in live if number is None or r.number == number]
        if number is not None and not chosen:
            there = ", ".join(str(r.number) for r in live) or "none"
            return {"ok": False, "error": f"no fault {number} to clear; there are: {there}"}
        for running in chosen:
            if running.phase is Phase.ACTIVE:
                self._end(running, now_ns, "cleared")
            else:
                running.phase = Phase.OVER
                self._note(running, now_ns, "cleared")
        self._arrange()
        return {"ok": True, "cleared": [r.number for r in chosen]}

    def _add(self, number: int, fault: Fault, zero_ns: int) -> _Running:
        begins_ns = zero_ns + fault.at_ns
        # A generator per fault, seeded by its number: a fault that is added or removed does not change the random
        # choices of the others.
        generator = random.Random(f"{self._seed}/{number}")
        running = _Running(
            number=number,
            fault=fault,
            effect=fault.settings.effect(generator),
            begins_ns=begins_ns,
            ends_ns=None if fault.for_ns is None else begins_ns + fault.for_ns,
        )
        self._running.append(running)
        # the scripted faults keep the low numbers, so they act before those of live commands
        self._running.sort(key=lambda each: each.number)
        self._arrange()
        return running

    def _advance(self, now_ns: int) -> int:
        """Begin and end the faults that are due, in the order of time; returns the time that counts."""
        if now_ns > self._now_ns:
            self._now_ns = now_ns
        # one change at a time: the end of one fault and the begin of the next act on frames in between
        while self._change_ns is not None and self._change_ns <= self._now_ns:
            at_ns = self._change_ns
            for running in self._running:
                if running.phase is Phase.WAITING and running.begins_ns <= at_ns:
                    self._begin(running)
                elif (
                    running.phase is Phase.ACTIVE and running.ends_ns is not None and running.ends_ns <= at_ns
                ):
                    self._end(running, at_ns, "ends")
                elif running.phase is Phase.DRAINING and running.effect.drained_ns <= at_ns:
                    running.phase = Phase.OVER
            self._arrange()
        return self._now_ns

    def _arrange(self) -> None:
        """Compute the active faults, and the time of the next change."""
        self._acting = [r for r in self._running if r.phase in (Phase.ACTIVE, Phase.DRAINING)]
        self._concerned.clear()
        self._change_ns = min((t for r in self._running if (t := _changes_ns(r)) is not None), default=None)

    def _begin(self, running: _Running) -> None:
        running.phase = Phase.ACTIVE
        running.effect.begin(running.begins_ns)
        self._outbox.actions += running.effect.begins_with
        self._note(running, running.begins_ns, "begins")

    def _end(self, running: _Running, at_ns: int, what: str) -> None:
        # frames that were due before the end still belong to the fault, then those that it holds back
        last = [*running.effect.due(at_ns - 1), *running.effect.end()]
        self._outbox.frames += last
        running.strike(at_ns, len(last))
        self._outbox.actions += running.effect.ends_with
        running.phase = Phase.DRAINING
        self._note(running, at_ns, what)

    def _note(self, running: _Running, at_ns: int, what: str) -> None:
        self.events.append(FaultEvent(at_ns, running.number, running.fault.label, what, running.struck))

    def _who_is_concerned(self, side: Side, can_id: int) -> list[_Running]:
        """The faults that act on such frames; remembered, but for a flood of random identifiers."""
        # a babbling node may send random identifiers: the memory must not grow with them
        if len(self._codecs) >= REMEMBERED:
            self._codecs.clear()
            self._concerned.clear()
        codec = self._codecs[can_id] = self._database.match(can_id)
        concerned = [running for running in self._acting if running.fault.selection.covers(side, codec)]
        self._concerned[side, can_id] = concerned
        return concerned


def _through(
    running: _Running, planned: Sequence[Planned], side: Side, codec: MessageCodec | None
) -> Sequence[Planned]:
    """The frames after one fault."""
    if running.phase is Phase.DRAINING:
        # a fault that is over changes nothing, but later frames must not overtake those that it delayed
        return [running.effect.follow(each) for each in planned]
    left: list[Planned] = []
    for each in planned:
        became = running.effect.passed(each, side, codec)
        running.strike(each.at_ns, int(len(became) != 1 or became[0] is not each))
        left += became
    return left


def _changes_ns(running: _Running) -> int | None:
    """When the fault's phase changes next by itself."""
    match running.phase:
        case Phase.WAITING:
            return running.begins_ns
        case Phase.ACTIVE:
            return running.ends_ns
        case Phase.DRAINING:
            return running.effect.drained_ns
        case Phase.OVER:
            return None


def _listed(running: _Running, now_ns: int) -> dict[str, object]:
    """One line of the list; times in seconds from now."""
    ends_ns = running.ends_ns
    return {
        "number": running.number,
        "fault": running.fault.label,
        "phase": running.phase.value,
        "begins_in_s": (running.begins_ns - now_ns) / SECOND,
        "ends_in_s": None if ends_ns is None else (ends_ns - now_ns) / SECOND,
        "struck": running.struck,
    }
