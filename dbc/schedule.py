"""Schedules the cyclic frames of one sender: each message at its DBC cycle time, with a fixed phase.

Slower messages are spread over the ticks so that no tick carries more frames than it must.
Cycle times, protection and ranges come from the DBC; units are checked against it at start-up.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from bus.rows import CLASSIC, Rows
from dbc.database import Database, MessageCodec
from dbc.packing import Packer, Signals


class FrameSchedule:
    """Makes the frames of one sender."""

    def __init__(
        self,
        database: Database,
        sender: str,
        messages: Mapping[str, Signals],
        *,
        tick_ns: int,
        sources: Sequence[str] | None = None,
    ) -> None:
        """sources: names of the values in the order of the vector that `pack` takes."""
        _check_complete(database, sender, messages)
        # fast messages first: they load every tick, and slow ones can still be placed between them
        codecs = sorted((database.by_name[name] for name in messages), key=lambda codec: codec.cycle_ns)
        if longer := next((codec for codec in codecs if codec.length > CLASSIC), None):
            raise ValueError(
                f"{longer.name} has {longer.length} bytes; frames are made as rows, which hold {CLASSIC} at most"
            )
        cycles = [_ticks(codec, tick_ns) for codec in codecs]
        self._packer = Packer([(codec, messages[codec.name]) for codec in codecs], sources)
        self._plans = [self._packer.plan(due) for due in due_messages(cycles, phases(cycles))]
        self._sources = self._packer.sources

    def frames(self, tick: int, values: Mapping[str, float]) -> list[Frame]:
        """The frames due at tick number `tick`; values: SI, by name."""
        return self.pack(
            tick, np.fromiter(map(values.__getitem__, self._sources), np.float64, len(self._sources))
        )

    def pack(self, tick: int, values: NDArray[np.float64], at_ns: int = 0) -> list[Frame]:
        """The same from the values as a vector in the order of `sources`, stamped `at_ns`."""
        return self._packer.pack(self._plans[tick % len(self._plans)], values, at_ns)

    def fill(self, tick: int, values: NDArray[np.float64]) -> tuple[Rows, int]:
        """The same as rows, and how many: those of one tick, which the next call overwrites."""
        plan = self._plans[tick % len(self._plans)]
        return self._packer.fill(plan, values), plan.due.size

    def pack_many(
        self, ticks: Sequence[int], values: NDArray[np.float64], stamps_ns: Sequence[int]
    ) -> NDArray[np.void]:
        """The same as `pack` for each tick with its row of values and its stamp, in one call of compiled code: a table of bus.rows.LAYOUT."""
        plans = [self._plans[tick % len(self._plans)] for tick in ticks]
        return self._packer.pack_many(plans, values, stamps_ns)


def phases(cycles: Sequence[int]) -> list[int]:
    """A phase for each cycle, both in ticks: the quietest so far, the earliest of equals."""
    load = [0] * math.lcm(*cycles)
    chosen = []
    for every in cycles:
        # greedy: exact balancing is a packing problem, and a few messages do not need it
        phase = min(range(every), key=lambda phase: max(load[phase::every]))
        for tick in range(phase, len(load), every):
            load[tick] += 1
        chosen.append(phase)
    return chosen


def due_messages(cycles: Sequence[int], phases: Sequence[int]) -> list[list[int]]:
    """Of each tick until everything repeats, which messages are due."""
    return [
        [
            number
            for number, (every, phase) in enumerate(zip(cycles, phases, strict=True))
            if tick % every == phase
        ]
        for tick in range(math.lcm(*cycles))
    ]


def _check_complete(database: Database, sender: str, messages: Mapping[str, Signals]) -> None:
    """Every message of the sender is made here, and no other."""
    of_sender = {name for name, codec in database.by_name.items() if sender in codec.senders}
    missing, foreign = sorted(of_sender - set(messages)), sorted(set(messages) - of_sender)
    if missing or foreign:
        raise ValueError(
            f"the DBC and this side differ on what {sender} sends: {missing} not made, {foreign} unknown"
        )


def _ticks(codec: MessageCodec, tick_ns: int) -> int:
    """Cycle time in ticks."""
    every, rest = divmod(codec.cycle_ns, tick_ns)
    if every < 1 or rest:
        raise ValueError(
            f"{codec.name}: cycle time {codec.cycle_ns} ns is no multiple of the tick, {tick_ns} ns"
        )
    return every
