"""Types shared by all faults: sides, frames with their departure, actions, and the interface of an effect.

Pure: frames and integer nanoseconds in, frames and the time of their departure out.
"""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

from bus.frame import Frame
from dbc.database import MessageCodec

Side = Literal["plant", "ecu"]
"""The side that a frame comes from; it goes to the other one."""
SIDES: tuple[Side, Side] = ("plant", "ecu")
OTHER: dict[Side, Side] = {"plant": "ecu", "ecu": "plant"}
NODES: dict[str, Side] = {"Machine": "plant", "EstimatorEcu": "ecu"}
"""Node of the DBC -> side."""


class Planned(NamedTuple):
    """A frame to be sent at `at_ns`, now or later."""

    at_ns: int
    frame: Frame


@dataclass(frozen=True, slots=True)
class Action:
    """An action on a process or controller, which the caller has to carry out.

    bus_off: the controller on the bus of side `target` falls silent and deaf; bus_on: it is back.
    kill: the process `target` is to end by SIGKILL; restart: it is to be started again.
    """

    kind: Literal["bus_off", "bus_on", "kill", "restart"]
    target: Side


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """The frames that a fault affects."""

    codecs: tuple[MessageCodec, ...] = ()  # messages; () for every frame, known to the DBC or not
    side: Side | None = None  # sender's side; None for both

    def covers(self, side: Side, codec: MessageCodec | None) -> bool:
        """Whether a frame from `side`, which the DBC knows as `codec`, is selected."""
        if self.side is not None and side != self.side:
            return False
        return not self.codecs or codec in self.codecs


class Effect:
    """Base class of the behaviour of one fault; this one does nothing.

    A frame that passes becomes any number of planned frames. Frames that a fault makes itself, or held
    back for longer, come out of `due`.
    """

    begins_with: tuple[Action, ...] = ()
    ends_with: tuple[Action, ...] = ()

    def begin(self, now_ns: int) -> None:
        """The fault begins."""

    def passed(self, planned: Planned, side: Side, codec: MessageCodec | None) -> Sequence[Planned]:
        """The frames to send in place of a selected one."""
        return (planned,)

    def follow(self, planned: Planned) -> Planned:
        """A frame after the end of the fault, until `drained_ns`, moved behind those that are still delayed."""
        return planned

    @property
    def drained_ns(self) -> int:
        """When the last frame that this fault delays is sent."""
        return 0

    def due(self, now_ns: int) -> Sequence[tuple[Side, Frame]]:
        """Frames that the fault sends by itself, with the side they come from."""
        return ()

    def next_ns(self) -> int | None:
        """When `due` has something next."""
        return None

    def end(self) -> Sequence[tuple[Side, Frame]]:
        """End the fault: the frames that it still holds back, to be sent at once."""
        return ()


class Settings(Protocol):
    """The checked parameters of one kind of fault."""

    def effect(self, generator: random.Random) -> Effect:
        """A fresh effect, with random numbers of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault as read from its table."""

    kind: str
    label: str  # kind, message and parameters, without times: for lists, logs and expectations
    selection: Selection
    at_ns: int  # begin, after the start of the run
    for_ns: int | None  # duration; None: until the end of the run
    settings: Settings
