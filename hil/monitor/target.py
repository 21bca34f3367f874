"""Parses the arguments of `loaderhil monitor`: a bus or a recording, and the filters after its name."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

from bus.user_error import UserError
from hil.monitor.filters import Filters

ANY = "any"
"""Every CAN interface of this machine that is up."""
_SOCKETCAN = "socketcan:"
_SCHEMES = ("hub", "socketcan", "virtual")
STDIN = "-"


class TargetError(UserError, ValueError):
    """The argument is neither a bus nor a recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One bus or one recording."""

    name: str  # as lines show it
    address: str = ""  # of a bus
    path: Path | None = None  # of a recording; `-` is standard input
    filters: Filters = field(default_factory=Filters)

    @classmethod
    def parse(cls, text: str) -> Self:
        """`ADDRESS|INTERFACE|FILE[,FILTER]...`; a name without any mark of the others is an interface, as in candump.

        TargetError if it is a file that does not exist, FilterError for a bad filter.
        """
        if text == STDIN or Path(text).is_file():  # also a file with a comma in its name
            return cls(name=text, path=Path(text))
        where, *filters = text.split(",")
        parsed = Filters.parse(filters)
        scheme, _, rest = where.partition(":")
        if scheme in _SCHEMES and rest:
            return cls(name=_short_name(scheme, rest), address=where, filters=parsed)
        if where == STDIN or Path(where).is_file():
            return cls(name=where, path=Path(where), filters=parsed)
        if not where or any(mark in where for mark in "/.: "):
            raise TargetError(
                f"'{where}': no such file, and no bus; write hub:PATH, socketcan:INTERFACE, virtual:NAME, "
                "the name of an interface, or a recording's"
            )
        return cls(name=where, address=f"{_SOCKETCAN}{where}", filters=parsed)

    def with_errors(self, mask: int) -> Self:
        """The same with error frames of these classes, unless its filters have a mask of their own."""
        return self if self.filters.errors else replace(self, filters=replace(self.filters, errors=mask))

    @property
    def interface(self) -> str:
        """The CAN interface, '' if it is something else."""
        return self.address.removeprefix(_SOCKETCAN) if self.address.startswith(_SOCKETCAN) else ""


def _short_name(scheme: str, rest: str) -> str:
    """What lines call a bus: an interface's or virtual bus' name, a hub's file without folder and ending."""
    return (Path(rest).stem or rest).removeprefix("@") if scheme == "hub" else rest
