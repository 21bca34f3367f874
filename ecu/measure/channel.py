"""A pair of CAN identifiers on which a tool and the ECU talk."""

from dataclasses import dataclass
from typing import Final, Self

from bus.frame import ERROR, EXTENDED, EXTENDED_MASK, FD, REMOTE, STANDARD_MASK, Frame
from bus.user_error import UserError
from dbc.database import Database

EXAMPLE: Final = "0x18EF80F9,0x18EFF980"
"""J1939's PGN for what a manufacturer defines: the tool has address 0xF9, the ECU 0x80."""


class ChannelError(UserError, ValueError):
    """The identifiers cannot be used."""


@dataclass(frozen=True, slots=True)
class Channel:
    """Identifiers as Linux' `can_id` words."""

    receive: int  # of the tool's frames
    send: int  # of the ECU's

    @classmethod
    def parse(cls, text: str, database: Database) -> Self:
        """From "RECEIVE,SEND"; beyond 0x7FF an identifier has 29 bits. Raises ChannelError, also for those in the DBC."""
        parts = text.split(",")
        try:
            numbers = [int(part, 0) for part in parts]
        except ValueError:
            numbers = []
        if len(numbers) != 2:
            raise ChannelError(
                f"{text!r}: give two CAN identifiers, that of the tool and that of the ECU, such as {EXAMPLE}"
            )
        for number in numbers:
            if not 0 <= number <= EXTENDED_MASK:
                raise ChannelError(
                    f"{text!r}: {number:#x} is no CAN identifier; they reach from 0 to {EXTENDED_MASK:#x}"
                )
        words = [number | (EXTENDED if number > STANDARD_MASK else 0) for number in numbers]
        if words[0] == words[1]:
            raise ChannelError(
                f"{text!r}: tool and ECU need different identifiers: their frames would collide"
            )
        for word in words:
            if word in database.by_id:
                raise ChannelError(
                    f"{text!r}: {word & EXTENDED_MASK:#x} is the identifier of {database.by_id[word].name}; take a free one"
                )
        return cls(*words)

    def data_of(self, frame: Frame) -> bytes | None:
        """The bytes of a classic data frame to the ECU; None for any other frame."""
        if frame.can_id != self.receive or frame.can_id & (REMOTE | ERROR) or frame.flags & FD:
            return None
        return frame.data if 0 < len(frame.data) <= 8 else None
