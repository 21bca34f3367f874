"""Reading calibrations: a table of a TOML file becomes a named tuple or dataclass of floats in SI.

The unit is the end of the key; an error names file, key, value, unit and permitted range.
"""

import difflib
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bus.mistake import Mistake

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


class CalibrationError(Mistake, ValueError):
    """A calibration file cannot be used; the message says where and why."""


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


def read_toml(path: Path) -> dict[str, object]:
    """The tables of a file."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(f"{path}: cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise CalibrationError(f"{path}: not valid TOML: {error}") from error


def read_table(
    tables: Mapping[str, object], section: str, quantities: Mapping[str, Quantity], path: Path
) -> dict[str, float]:
    """The numbers of one section in SI, by field name; also demands a non-empty `source`."""
    table = tables.get(section)
    if not isinstance(table, dict):
        raise CalibrationError(f"{path}: table [{section}] is missing")
    known = {quantity.key for quantity in quantities.values()} | {"source"}
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, sorted(known), n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise CalibrationError(f"{path}: {section}.{key} is not a known key{hint}")
    source = table.get("source")
    if not isinstance(source, str) or not source.strip():
        raise CalibrationError(f"{path}: {section}.source is missing: say where the numbers come from")
    return {field: _number(table, section, quantity, path) for field, quantity in quantities.items()}


def _number(table: Mapping[str, object], section: str, quantity: Quantity, path: Path) -> float:
    where, unit = f"{path}: {section}.{quantity.key}", quantity.unit
    if quantity.key not in table:
        raise CalibrationError(f"{where} is missing ({quantity.low:g}..{quantity.high:g} {unit})")
    value = table[quantity.key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise CalibrationError(f"{where} = {value!r} is not a number of {unit}")
    if not quantity.low <= value <= quantity.high:
        raise CalibrationError(
            f"{where} = {value:g} {unit} is outside {quantity.low:g}..{quantity.high:g} {unit}"
        )
    return quantity.si(float(value))
