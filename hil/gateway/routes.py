"""Decides which frames cross the gateway: by the DBC's senders and receivers, unless a rule overrides them.

A message crosses from the side of its sender if a node on the other side receives one of its
signals. A message that appears on the side where its sender is not was sent by another node, and stays
there: on its own side the true sender may be active too. An identifier that the DBC does not know has no receiver.
"""

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

from bus.frame import ERROR, REMOTE
from dbc.database import Database, MessageCodec

Side = Literal["plant", "ecu"]
SIDES: Final[tuple[Side, Side]] = ("plant", "ecu")
OTHER: Final[Mapping[Side, Side]] = {"plant": "ecu", "ecu": "plant"}
NODES: Final[Mapping[Side, frozenset[str]]] = {
    "plant": frozenset({"Machine"}),
    "ecu": frozenset({"EstimatorEcu"}),
}
"""Nodes of loader.dbc by the side they are on."""
KNOWN_LIMIT = 4096
"""Identifiers whose fate is remembered per side; a flood of random ones must not fill the memory."""


class Fate(enum.Enum):
    """The decision on a frame; the value is the text of a finding."""

    PASS = "passed on"
    UNWANTED = "nobody on the other side receives it"
    WRONG_SIDE = "its sender is on the other side"
    UNKNOWN = "the DBC does not know its identifier"
    BLOCKED = "a rule blocks it"
    NOT_DATA = "an error or remote frame stays on its bus"


@dataclass(frozen=True, slots=True)
class Rule:
    """An exception from the DBC's senders and receivers."""

    can_id: int
    side_from: Side
    passes: bool


class Routes:
    """The fate of every identifier on either side."""

    def __init__(
        self,
        database: Database,
        *,
        nodes: Mapping[Side, frozenset[str]] = NODES,
        rules: Iterable[Rule] = (),
        unknown_passes: bool = False,
    ) -> None:
        """nodes: of the DBC on each side; unknown_passes: whether identifiers it does not know cross."""
        self.database = database
        self._nodes = nodes
        self._rules = {(rule.side_from, rule.can_id): rule.passes for rule in rules}
        self._unknown = Fate.PASS if unknown_passes else Fate.UNKNOWN
        self._fates: dict[Side, dict[int, Fate]] = {side: {} for side in SIDES}

    def fate(self, side_from: Side, can_id: int) -> Fate:
        """The decision on frames with this `can_id` word that come from `side_from`."""
        known = self._fates[side_from]
        fate = known.get(can_id)
        if fate is None:
            fate = self._decide(side_from, can_id)
            # beyond it the decision is made anew for each frame: slower, but a flood cannot exhaust the memory
            if len(known) < KNOWN_LIMIT:
                known[can_id] = fate
        return fate

    def _decide(self, side_from: Side, can_id: int) -> Fate:
        # an error frame describes the bus that it was seen on; a remote request asks a node of that bus
        if can_id & (ERROR | REMOTE):
            return Fate.NOT_DATA
        passes = self._rules.get((side_from, can_id))
        if passes is not None:
            return Fate.PASS if passes else Fate.BLOCKED
        codec = self.database.match(can_id)
        return self._unknown if codec is None else self._by_database(side_from, codec)

    def _by_database(self, side_from: Side, codec: MessageCodec) -> Fate:
        # sender before receiver: two copies of one message on the other bus would break its alive counter
        if self._nodes[OTHER[side_from]].intersection(codec.senders):
            return Fate.WRONG_SIDE
        if self._nodes[OTHER[side_from]].intersection(codec.receivers):
            return Fate.PASS
        return Fate.UNWANTED

    def crossing(self, side_from: Side) -> list[MessageCodec]:
        """The messages of the DBC that cross from `side_from`, in the order of the file."""
        codecs = self.database.by_name.values()
        return [codec for codec in codecs if self.fate(side_from, codec.can_id) is Fate.PASS]
