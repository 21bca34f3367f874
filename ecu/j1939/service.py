"""J1939 as a service of the ECU: it claims the ECU's address, keeps the ECU silent without one, and answers requests.

Served requests: the address claim, the software identification and the component identification. A request to the ECU alone for
anything that it does not send is refused, as J1939-21 asks; groups that it sends anyway come with their next cycle.
"""

import logging
from collections import deque
from collections.abc import Callable, Mapping
from typing import Final

from bus.frame import Frame
from dbc.database import Database
from dbc.j1939 import pgn, source_address
from ecu.j1939.claim import ADDRESS_CLAIMED, GLOBAL, AddressClaim, State, is_message, message
from ecu.j1939.name import Name
from ecu.outputs import ECU

REQUEST: Final = 0xEA00
ACKNOWLEDGEMENT: Final = 0xE800
TRANSPORT_CONTROL: Final = 0xEC00
TRANSPORT_DATA: Final = 0xEB00
SOFTWARE: Final = 0xFEDA
COMPONENT: Final = 0xFEEB
REFUSED, BUSY = 1, 3
"""Control bytes of an acknowledgement."""
BROADCAST: Final = 0x20
"""Control byte of an announcement to all (BAM)."""
PIECE: Final = 7
"""Bytes of a long message in one frame."""
COMPONENT_TAIL: Final = b"**"
"""Ends the identity in the component identification, and the number of the unit in the machine, which has none."""
PIECE_NS: Final = 50_000_000
"""Least time between two frames of a message to all."""

log = logging.getLogger(__name__)


class J1939Service:
    """Network management of one ECU."""

    def __init__(self, claim: AddressClaim, texts: Mapping[int, bytes], sent: frozenset[int]) -> None:
        """texts: answers by parameter group; sent: groups that the ECU sends of its own accord."""
        self._claim, self._texts, self._sent = claim, texts, sent
        self._pieces: deque[Frame] = deque()
        self._piece_ns = 0

    @property
    def state(self) -> State:
        """Of the address."""
        return self._claim.state

    def may_send(self) -> bool:
        """Whether the ECU has its address."""
        return self._claim.state is State.OWNED

    def receive(self, frame: Frame, now_ns: int) -> list[Frame]:
        """Answer a claim or a request."""
        if is_message(frame, REQUEST):
            return self._requested(frame, now_ns)
        claim, before = self._claim, self._claim.lost_to
        frames = claim.receive(frame, now_ns)
        if claim.lost_to != before:
            log.error(
                "address 0x%02X belongs to NAME %016X, which ours, %016X, does not outrank: the ECU sends nothing until it is restarted",
                claim.address,
                claim.lost_to,
                claim.name,
            )
        return frames

    def before_cycle(self, now_ns: int) -> None:
        """Nothing: a cycle computes the same with an address or without."""

    def after_cycle(self, now_ns: int) -> list[Frame]:
        """The first claim; later what is due of claim and long answer."""
        if self._claim.state is State.SILENT:
            return self._claim.start(now_ns)
        frames = self._claim.pending(now_ns)
        if not self.may_send():
            self._pieces.clear()
        elif self._pieces and now_ns >= self._piece_ns:
            self._piece_ns = now_ns + PIECE_NS
            frames = [*frames, self._pieces.popleft()]
        return frames

    def _requested(self, frame: Frame, now_ns: int) -> list[Frame]:
        to = frame.can_id >> 8 & 0xFF
        if to not in (GLOBAL, self._claim.address) or len(frame.data) != 3:
            return []
        group = int.from_bytes(frame.data, "little")
        if group == ADDRESS_CLAIMED:
            return self._claim.requested(now_ns)
        if not self.may_send() or group in self._sent:
            return []
        if group not in self._texts:
            return self._refusal(frame, group, REFUSED) if to != GLOBAL else []
        if self._pieces:
            return self._refusal(frame, group, BUSY) if to != GLOBAL else []
        self._pieces.extend(_pieces(group, self._claim.address, self._texts[group]))
        self._piece_ns = now_ns + PIECE_NS
        return [self._pieces.popleft()]

    def _refusal(self, frame: Frame, group: int, why: int) -> list[Frame]:
        asking = source_address(frame.can_id)
        data = bytes((why, 0xFF, 0xFF, 0xFF, asking)) + group.to_bytes(3, "little")
        return [message(ACKNOWLEDGEMENT, self._claim.address, data)]


def _pieces(group: int, source: int, text: bytes) -> list[Frame]:
    """A message to all: its announcement, then its bytes, seven to a frame."""
    count = -(-len(text) // PIECE)
    head = bytes((BROADCAST, *len(text).to_bytes(2, "little"), count, 0xFF)) + group.to_bytes(3, "little")
    frames = [message(TRANSPORT_CONTROL, source, head, priority=7)]
    for k in range(count):
        piece = text[PIECE * k : PIECE * (k + 1)].ljust(PIECE, b"\xff")
        frames.append(message(TRANSPORT_DATA, source, bytes((k + 1,)) + piece, priority=7))
    return frames


def j1939_service(
    name: Name, database: Database, *, calibration: str, version: str, random: Callable[[], int]
) -> J1939Service:
    """J1939 for the estimator ECU of a DBC. random: gives 0 to 255."""
    claim = AddressClaim(int(name), address_of(database), random)
    identity = str(name.identity).encode()
    texts = {
        SOFTWARE: software_text(version),
        COMPONENT: component_head(calibration) + identity + COMPONENT_TAIL,
    }
    return J1939Service(claim, texts, sent_groups(database))


def address_of(database: Database) -> int:
    """The address in the identifiers of the ECU's messages."""
    return source_address(next(c.can_id for c in database.by_id.values() if ECU in c.senders))


def sent_groups(database: Database) -> frozenset[int]:
    """Parameter groups that the ECU sends of its own accord."""
    return frozenset(pgn(c.can_id) for c in database.by_id.values() if ECU in c.senders)


def software_text(version: str) -> bytes:
    """The software identification: one field."""
    return b"\x01" + f"loaderhil {version}*".encode()


def component_head(calibration: str) -> bytes:
    """The component identification up to the identity of the unit: make and model."""
    return f"loaderhil*{calibration}*".encode()
