"""Faults that delay frames: by a fixed time, by a random time, or behind later frames."""

import random
from collections.abc import Sequence
from dataclasses import dataclass

from bus.frame import Frame
from configuration import CheckedTable
from dbc.database import MessageCodec
from hil.faults.loss import MS, read_probability
from hil.faults.passage import Effect, Planned, Side

ACYCLIC_NS = 100 * MS
"""Stands for the cycle time of a message that has none."""


@dataclass(frozen=True, slots=True)
class Delay:
    """Every frame is delayed by a uniformly random time; no frame overtakes another of its message."""

    least_ns: int
    most_ns: int  # equal to `least_ns` for a fixed delay

    def effect(self, generator: random.Random) -> Effect:
        return _Delaying(self, generator)


class _Delaying(Effect):
    """A queue per message; the order is kept also when the fault ends, because a bus does not reorder."""

    def __init__(self, settings: Delay, generator: random.Random) -> None:
        self._settings, self._generator = settings, generator
        self._last_ns: dict[int, int] = {}

    def passed(self, planned: Planned, side: Side, codec: MessageCodec | None) -> Sequence[Planned]:
        least_ns, most_ns = self._settings.least_ns, self._settings.most_ns
        # a fixed delay draws no random number, so that it does not depend on the seed
        delay_ns = least_ns if least_ns == most_ns else self._generator.randint(least_ns, most_ns)
        behind = self.follow(Planned(planned.at_ns + delay_ns, planned.frame))
        self._last_ns[planned.frame.can_id] = behind.at_ns
        return (behind,)

    def follow(self, planned: Planned) -> Planned:
        last_ns = self._last_ns.get(planned.frame.can_id, 0)
        # also a jittered frame stays behind its predecessor: the order within a message is that of a real bus
        return planned if planned.at_ns >= last_ns else Planned(last_ns, planned.frame)

    @property
    def drained_ns(self) -> int:
        return max(self._last_ns.values(), default=0)


@dataclass(frozen=True, slots=True)
class Reorder:
    """A frame is held back, with a probability, until `depth` later frames of its message have overtaken it."""

    probability: float
    depth: int

    def effect(self, generator: random.Random) -> Effect:
        return _Reordering(self, generator)


@dataclass(slots=True)
class _Held:
    """A frame that waits to be overtaken by `ahead` more of its message, at most until `until_ns`."""

    side: Side
    frame: Frame
    ahead: int
    until_ns: int


class _Reordering(Effect):
    """Holds back one frame of a message at a time; one that is not overtaken is sent after depth + 2 cycle times."""

    def __init__(self, settings: Reorder, generator: random.Random) -> None:
        self._settings, self._random = settings, generator.random
        self._held: dict[int, _Held] = {}

    def passed(self, planned: Planned, side: Side, codec: MessageCodec | None) -> Sequence[Planned]:
        can_id = planned.frame.can_id
        held = self._held.get(can_id)
        if held is not None:
            # counts the frames that overtake; the last of them takes the held frame with it
            held.ahead -= 1
            if held.ahead > 0:
                return (planned,)
            del self._held[can_id]
            return planned, Planned(planned.at_ns, held.frame)
        if self._random() >= self._settings.probability:
            return (planned,)
        cycle_ns = (codec.cycle_ns if codec is not None else 0) or ACYCLIC_NS
        # the sender may stop: without a limit the held frame would never arrive
        until_ns = planned.at_ns + (self._settings.depth + 2) * cycle_ns
        self._held[can_id] = _Held(side, planned.frame, self._settings.depth, until_ns)
        return ()

    def due(self, now_ns: int) -> Sequence[tuple[Side, Frame]]:
        late = [can_id for can_id, held in self._held.items() if held.until_ns <= now_ns]
        return [self._released(can_id) for can_id in late]

    def next_ns(self) -> int | None:
        return min((held.until_ns for held in self._held.values()), default=None)

    def end(self) -> Sequence[tuple[Side, Frame]]:
        return [self._released(can_id) for can_id in list(self._held)]

    def _released(self, can_id: int) -> tuple[Side, Frame]:
        held = self._held.pop(can_id)
        return held.side, held.frame


def read_delay(table: CheckedTable) -> Delay:
    """kind = "delay"."""
    delay_ns = round(table.number("delay_ms", unit="ms", low=0.0, high=60_000.0) * MS)
    return Delay(delay_ns, delay_ns)


def read_jitter(table: CheckedTable) -> Delay:
    """kind = "jitter": between nothing and `jitter_ms`."""
    return Delay(0, round(table.number("jitter_ms", unit="ms", low=0.0, high=60_000.0) * MS))


def read_reorder(table: CheckedTable) -> Reorder:
    """kind = "reorder"."""
    return Reorder(read_probability(table), table.integer("depth", low=1, high=7, default=1))
