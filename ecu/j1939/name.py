"""The NAME of a controller (J1939-81): 64 bits that no other controller on the bus has. The lower NAME wins an address."""

from dataclasses import dataclass, field, fields
from typing import Final, Self

from bus.user_error import UserError

EXAMPLE: Final = "identity=1,manufacturer=0"


class BadName(UserError, ValueError):
    """The words do not give a NAME."""


def _bits(count: int, at: int, default: int | None = None) -> int:
    """A field of the NAME: its width, its lowest bit, its value where none is given."""
    meta = {"count": count, "at": at}
    found: int = field(metadata=meta) if default is None else field(metadata=meta, default=default)
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Name:
    """The fields of a NAME. A default says "not available", and construction equipment as the industry."""

    identity: int = _bits(21, 0)  # of this one unit: the manufacturer gives each another
    manufacturer: int = _bits(11, 21)  # as SAE assigned it
    ecu_instance: int = _bits(3, 32, 0)
    function_instance: int = _bits(5, 35, 0)
    function: int = _bits(8, 40, 255)
    vehicle_system: int = _bits(7, 49, 127)
    vehicle_system_instance: int = _bits(4, 56, 0)
    industry: int = _bits(3, 60, 3)

    @classmethod
    def parse(cls, text: str) -> Self:
        """From "identity=1,manufacturer=0,..."; numbers may be hexadecimal. Raises BadName."""
        known = {f.name: f.metadata["count"] for f in fields(cls)}
        values: dict[str, int] = {}
        for word in text.split(","):
            key, _, digits = word.strip().partition("=")
            if key not in known:
                raise BadName(f"{text!r}: a NAME has no field {key!r}; it has {', '.join(known)}")
            try:
                values[key] = int(digits, 0)
            except ValueError:
                raise BadName(f"{text!r}: {key} is no whole number: {digits!r}") from None
            most = (1 << known[key]) - 1
            if not 0 <= values[key] <= most:
                raise BadName(f"{text!r}: {key} is {values[key]} and may be 0 to {most}")
        missing = [key for key in ("identity", "manufacturer") if key not in values]
        if missing:
            raise BadName(f"{text!r}: a NAME needs {' and '.join(missing)}, as in {EXAMPLE}")
        return cls(**values)

    def __int__(self) -> int:
        """All 64 bits. The bit for "takes any address" is 0: the DBC fixes the ECU's identifiers."""
        return sum(getattr(self, f.name) << f.metadata["at"] for f in fields(self))
