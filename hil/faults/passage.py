"""What passes between the two sides, and what a fault may do to it.

Pure: frames and integer nanoseconds in, frames and the time of their departure out.
"""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

from bus.frame import Frame
from dbc.database import MessageCodec

Side = Literal["plant", "ecu"]
"""Where a frame comes from; it goes to the other side."""
SIDES: tuple[Side, Side] = ("plant", "ecu")
OTHER: dict[Side, Side] = {"plant": "ecu", "ecu": "plant"}
NODES: dict[str, Side] = {"Machine": "plant", "EstimatorEcu": "ecu"}
"""Nodes of the DBC and the side each stands for."""


class Planned(NamedTuple):
    """A frame that goes on at `at_ns`, now or later."""

    at_ns: int
    frame: Frame


@dataclass(frozen=True, slots=True)
class Action:
    """What the shell has to do beyond frames.

    bus_off: the controller on the bus of side `target` falls silent and deaf; bus_on: it is back.
    kill: the process `target` is to end by SIGKILL; restart: it is to be started again.
    """

    kind: Literal["bus_off", "bus_on", "kill", "restart"]
    target: Side


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Which frames a fault is about.

    codecs: the messages, empty for every frame, known to the DBC or not; side: None for both.
    """

    codecs: tuple[MessageCodec, ...] = ()
    side: Side | None = None

    def covers(self, side: Side, codec: MessageCodec | None) -> bool:
        """Whether a frame from `side` that the DBC knows as `codec` is meant."""
        if self.side is not None and side != self.side:
            return False
        return not self.codecs or codec in self.codecs


class Effect:
    """What one fault does while it lasts; this one does nothing.

    A frame that passes becomes any number of planned frames. Frames that a fault makes itself, or held
    back for longer, come out of `due`.
    """

    begins_with: tuple[Action, ...] = ()
    ends_with: tuple[Action, ...] = ()

    def begin(self, now_ns: int) -> None:
        """The fault begins."""

    def passed(self, planned: Planned, side: Side, codec: MessageCodec | None) -> Sequence[Planned]:
        """What becomes of a frame that the fault is about."""
        return (planned,)

    def follow(self, planned: Planned) -> Planned:
        """A frame after the end of the fault, until `drained_ns`: behind those that are still under way."""
        return planned

    @property
    def drained_ns(self) -> int:
        """When the last frame that this fault delays has gone on."""
        return 0

    def due(self, now_ns: int) -> Sequence[tuple[Side, Frame]]:
        """Frames that the fault sends by itself, with the side they come from."""
        return ()

    def next_ns(self) -> int | None:
        """When `due` has something next."""
        return None

    def end(self) -> Sequence[tuple[Side, Frame]]:
        """The fault is over: what it still holds goes on at once."""
        return ()


class Settings(Protocol):
    """The checked parameters of one kind of fault."""

    def effect(self, generator: random.Random) -> Effect:
        """The fault at work, with the random numbers of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault: what, on which frames, from when [ns after the start] for how long (None: to the end).

    label: the fault in the words of its table.
    """

    kind: str
    label: str
    selection: Selection
    at_ns: int
    for_ns: int | None
    settings: Settings
