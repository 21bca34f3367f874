"""When which frame goes out: each message at its DBC cycle time, with a fixed phase.

Slower messages are spread over the ticks so that no tick carries more frames than it must.
Cycle times, protection and ranges come from the DBC; units are checked against it at start-up.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from bus.frame import Frame
from dbc.binding import Binding
from dbc.database import Database, MessageCodec
from dbc.protection import Protector

Signals = Mapping[str, tuple[str, str]]
"""Of one message: signal -> (SI unit, name of the value that goes into it)."""


@dataclass(frozen=True, slots=True)
class _Outgoing:
    """One message: when it is due, and how it is made."""

    codec: MessageCodec
    binding: Binding
    sources: tuple[str, ...]
    protector: Protector | None
    every: int  # ticks
    phase: int  # tick within `every`

    def frame(self, values: Mapping[str, float]) -> Frame:
        data = self.binding.encode([values[source] for source in self.sources])
        return Frame(self.codec.can_id, self.protector.protect(data) if self.protector else data)


class FrameSchedule:
    """Makes the frames of one sender."""

    def __init__(
        self, database: Database, sender: str, messages: Mapping[str, Signals], *, tick_ns: int
    ) -> None:
        _check_complete(database, sender, messages)
        codecs = sorted((database.by_name[name] for name in messages), key=lambda codec: codec.cycle_ns)
        cycles = [_ticks(codec, tick_ns) for codec in codecs]
        self._outgoing = [
            _Outgoing(
                codec=codec,
                binding=Binding(codec, {signal: unit for signal, (unit, _) in messages[codec.name].items()}),
                sources=tuple(source for _, source in messages[codec.name].values()),
                protector=Protector(codec) if codec.e2e_data_id is not None else None,
                every=every,
                phase=phase,
            )
            for codec, every, phase in zip(codecs, cycles, phases(cycles), strict=True)
        ]

    def frames(self, tick: int, values: Mapping[str, float]) -> list[Frame]:
        """The frames due at tick number `tick`."""
        return [out.frame(values) for out in self._outgoing if tick % out.every == out.phase]


def phases(cycles: Sequence[int]) -> list[int]:
    """A phase for each cycle, both in ticks: the quietest so far, the earliest of equals."""
    load = [0] * math.lcm(*cycles)
    chosen = []
    for every in cycles:
        phase = min(range(every), key=lambda phase: max(load[phase::every]))
        for tick in range(phase, len(load), every):
            load[tick] += 1
        chosen.append(phase)
    return chosen


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
