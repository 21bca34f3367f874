"""What a test drives: the bench in lockstep, in real time, or a bus with a rest bus. One interface for all."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from bus.frame import Frame
from bus.user_error import UserError
from dbc.database import Database


class NotPossible(UserError, ValueError):
    """This kind of bench cannot do what was asked; the message says which can."""


class Driven(Protocol):
    """Times are seconds of the bench's own clock: virtual in lockstep, since the first frame elsewhere."""

    @property
    def database(self) -> Database:
        """Of the frames."""

    @property
    def now_s(self) -> float:
        """The time now."""

    @property
    def record(self) -> Sequence[Frame]:
        """Every frame so far, stamps on the bench's clock [ns]."""

    async def start(self) -> None:
        """Be ready for the first step."""

    async def advance(self, until_s: float) -> Sequence[Frame] | None:
        """Go on until frames came, or the time has come; the new frames, stamped. None when the bench has ended."""

    def truth(self) -> Mapping[str, Any]:
        """The plant's truth of this moment by field, SI; empty without a plant of ours."""

    def stimulate(self, message: str, signal: str, value: float) -> None:
        """From now on the receivers get this value, in the DBC's unit."""

    def inject(self, fault: Mapping[str, object]) -> str:
        """A [[fault]] table, whose at_s counts from now; its description."""

    def clear(self) -> None:
        """End every stimulus and fault."""

    async def stop(self) -> None:
        """End everything that was started; a second call does nothing."""

    def keep(self, folder: Path) -> Path:
        """Leave the recording in `folder`: a run directory, or the log of the bus. After `stop`."""
