"""Faults that lose or repeat frames."""

import random
from collections.abc import Sequence
from dataclasses import dataclass

from configuration import CheckedTable
from dbc.database import MessageCodec
from hil.faults.passage import Effect, Planned, Side

MS = 1_000_000


def read_probability(table: CheckedTable, default: float = 1.0) -> float:
    """The probability with which the fault affects a frame, 0 to 1."""
    return table.number("probability", unit="of 1", low=0.0, high=1.0, default=default)


@dataclass(frozen=True, slots=True)
class Drop:
    """Each frame is lost with a probability, independently of the others."""

    probability: float

    def effect(self, generator: random.Random) -> Effect:
        return _Dropping(self, generator)


class _Dropping(Effect):
    def __init__(self, settings: Drop, generator: random.Random) -> None:
        self._probability, self._random = settings.probability, generator.random

    def passed(self, planned: Planned, side: Side, codec: MessageCodec | None) -> Sequence[Planned]:
        return () if self._random() < self._probability else (planned,)


@dataclass(frozen=True, slots=True)
class Repeat:
    """Each frame is repeated, with a probability."""

    probability: float
    copies: int  # additional frames
    gap_ns: int  # between a frame and its next copy

    def effect(self, generator: random.Random) -> Effect:
        return _Repeating(self, generator)


class _Repeating(Effect):
    def __init__(self, settings: Repeat, generator: random.Random) -> None:
        self._settings, self._random = settings, generator.random

    def passed(self, planned: Planned, side: Side, codec: MessageCodec | None) -> Sequence[Planned]:
        settings = self._settings
        if self._random() >= settings.probability:
            return (planned,)
        at_ns, frame = planned
        return [Planned(at_ns + n * settings.gap_ns, frame) for n in range(settings.copies + 1)]


def read_drop(table: CheckedTable) -> Drop:
    """kind = "drop"."""
    return Drop(read_probability(table))


def read_repeat(table: CheckedTable) -> Repeat:
    """kind = "repeat"."""
    return Repeat(
        probability=read_probability(table),
        copies=table.integer("copies", low=1, high=100, default=1),
        gap_ns=round(table.number("gap_ms", unit="ms", low=0.0, high=10_000.0, default=0.0) * MS),
    )
