"""Reading calibrations: a table of a TOML file becomes a named tuple or dataclass of floats in SI.

The unit is the end of the key; an error names file, key, value, unit and permitted range.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from configuration import CheckedTable

DEGREE = math.pi / 180
UNITS: Mapping[str, tuple[str, float]] = {
    "_kg_m2": ("kg m2", 1.0),
    "_deg_s2": ("deg/s2", DEGREE),
    "_deg_s": ("deg/s", DEGREE),
    "_deg": ("deg", DEGREE),
    "_rad_s": ("rad/s", 1.0),
    "_per_rad": ("1/rad", 1.0),
    "_kn_s_per_m": ("kN s/m", 1e3),
    "_kn_per_m": ("kN/m", 1e3),
    "_kn_m_s": ("kN m/s", 1e3),
    "_kn_m": ("kN m", 1e3),
    "_kn": ("kN", 1e3),
    "_kmh": ("km/h", 1 / 3.6),
    "_m_s2": ("m/s2", 1.0),
    "_m_s": ("m/s", 1.0),
    "_per_s": ("1/s", 1.0),
    "_kpa": ("kPa", 1e3),
    "_mpa": ("MPa", 1e6),
    "_bar": ("bar", 1e5),
    "_kg": ("kg", 1.0),
    "_mm": ("mm", 1e-3),
    "_ms": ("ms", 1e-3),
    "_m": ("m", 1.0),
    "_s": ("s", 1.0),
}


@dataclass(frozen=True, slots=True)
class Quantity:
    """One number of a calibration: its key, and its permitted range in the key's unit."""

    key: str
    low: float
    high: float

    @property
    def suffix(self) -> str:
        """The unit's part of the key; "" for a pure number."""
        return next((suffix for suffix in UNITS if self.key.endswith(suffix)), "")

    @property
    def unit(self) -> str:
        """The unit for people."""
        return UNITS[self.suffix][0] if self.suffix else "1"

    def si(self, value: float) -> float:
        """`value` in SI."""
        return value * (UNITS[self.suffix][1] if self.suffix else 1.0)


def read_section(top: CheckedTable, section: str, quantities: Mapping[str, Quantity]) -> dict[str, float]:
    """The numbers of one section in SI, by field name; the section has to say its `source`."""
    if section not in top:
        raise top.error(f"[{section}]", "is missing")
    table = top.table(section)
    known = {"source", *(quantity.key for quantity in quantities.values())}
    for key in table.values:  # first: a misspelt key is not a missing one
        if key not in known:
            raise table.unknown(key, known)
    numbers = {
        field: q.si(table.number(q.key, unit=q.unit, low=q.low, high=q.high))
        for field, q in quantities.items()
    }
    if "source" not in table:
        raise table.error("source", "is missing: say where the numbers come from")
    table.text("source")
    return numbers
