"""Units as exponents of SI base units, so that every coefficient that is found has the right unit.

The radian is printed as a unit of its own and counts as 1 when two units are compared. Models use SI; units in headings of recordings
(km/h, deg, bar) are converted when recordings are read.
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

BASE = ("kg", "m", "s", "A", "K", "rad")
DERIVED = {
    "1": {},
    "%": {},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "Ω": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "S": {"kg": -1, "m": -2, "s": 3, "A": 2},
    "C": {"s": 1, "A": 1},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
    "T": {"kg": 1, "s": -2, "A": -1},
}
READABLE = ("N", "W", "Pa", "V")  # derived units in which others are written; no J, because a torque is none
HEAT = ("W", "J")  # beside a kelvin: a heat capacity is no torque, and a heat transfer no force
# units in headings of recordings: name -> SI unit, and its size in that unit
FOREIGN = {
    "km": ("m", 1e3), "cm": ("m", 1e-2), "mm": ("m", 1e-3), "um": ("m", 1e-6), "µm": ("m", 1e-6), "l": ("m^3", 1e-3),
    "h": ("s", 3600.0), "min": ("s", 60.0), "ms": ("s", 1e-3), "us": ("s", 1e-6), "µs": ("s", 1e-6), "ns": ("s", 1e-9),
    "deg": ("rad", math.pi / 180.0), "°": ("rad", math.pi / 180.0), "mrad": ("rad", 1e-3), "rev": ("rad", 2.0 * math.pi),
    "t": ("kg", 1e3), "kN": ("N", 1e3), "Nm": ("N.m", 1.0), "kNm": ("N.m", 1e3), "kW": ("W", 1e3), "kJ": ("J", 1e3),
    "bar": ("Pa", 1e5), "mbar": ("Pa", 1e2), "kPa": ("Pa", 1e3), "MPa": ("Pa", 1e6), "g": ("m/s^2", 9.80665),
    "%": ("1", 1e-2), "rpm": ("rad/s", math.pi / 30.0), "mV": ("V", 1e-3), "mA": ("A", 1e-3), "kHz": ("Hz", 1e3),
    "kV": ("V", 1e3), "uV": ("V", 1e-6), "µV": ("V", 1e-6), "uA": ("A", 1e-6), "µA": ("A", 1e-6), "kA": ("A", 1e3),
    "mW": ("W", 1e-3), "MW": ("W", 1e6), "Wh": ("J", 3600.0), "kWh": ("J", 3.6e6), "MJ": ("J", 1e6), "Ah": ("A.s", 3600.0),
    "mN": ("N", 1e-3), "MN": ("N", 1e6), "mNm": ("N.m", 1e-3), "hPa": ("Pa", 1e2),
    "kmh": ("m/s", 1.0 / 3.6), "kph": ("m/s", 1.0 / 3.6), "mph": ("m/s", 0.44704), "kn": ("m/s", 1852.0 / 3600.0),
    "ft": ("m", 0.3048), "in": ("m", 0.0254), "lb": ("kg", 0.45359237), "lbf": ("N", 4.4482216152605), "psi": ("Pa", 6894.757293168),
    "ml": ("m^3", 1e-6), "L": ("m^3", 1e-3), "sec": ("s", 1.0),
}  # fmt: skip
GRAM = {"g": ("kg", 1e-3)}
# temperature scales with another zero than the kelvin: size of a degree [K] and zero of the scale [K]; exact by definition
TEMPERATURES = {
    **dict.fromkeys(("°C", "degC", "deg C", "℃"), (1.0, 273.15)),
    **dict.fromkeys(("°F", "degF", "deg F"), (5.0 / 9.0, 459.67 * 5.0 / 9.0)),
}
_POWER = re.compile(r"(?<=[A-Za-z])\^?([23])(?!\d)")
SHOWN = 40  # characters of a unit in an error
POWER_DIGITS = 2  # with the sign: no quantity has a larger power, and a factor to it is no number any more
_FACTOR = re.compile(r"(1$|[A-Za-z%°µΩ]+)(?:\^?(-?\d+))?$")
_AROUND = re.compile(r"\s*([/.*·^()])\s*")


@dataclass(frozen=True, slots=True)
class Unit:
    """Exponents in the order of BASE."""

    exponents: tuple[Fraction, ...]

    def __mul__(self, other: "Unit") -> "Unit":
        return Unit(tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def __truediv__(self, other: "Unit") -> "Unit":
        return self * other**-1

    def __pow__(self, power: int | Fraction) -> "Unit":
        return Unit(tuple(a * power for a in self.exponents))

    def __str__(self) -> str:
        powers = self._with_fewest_factors()

        def write(sign: int) -> list[str]:
            return [name if abs(e) == 1 else f"{name}^{abs(e)}" for name, e in powers.items() if e * sign > 0]

        above, below = write(1), write(-1)
        if not below:
            return ".".join(above) or "1"
        bottom = below[0] if len(below) == 1 else f"({'.'.join(below)})"
        return f"{'.'.join(above) or '1'}/{bottom}"

    def _with_fewest_factors(self) -> dict[str, Fraction]:
        """Exponents by base unit, or beside one derived unit where that is shorter: 'N.m' instead of 'kg.m^2/s^2'."""
        ways = [dict(zip(BASE, self.exponents, strict=True))]
        readable = READABLE if self.exponents[BASE.index("kg")] else ()
        for name in (*HEAT, *readable) if self.exponents[BASE.index("K")] else readable:
            for power in (Fraction(1), Fraction(-1)):
                rest = (self / _si(name) ** power).exponents
                ways.append({name: power, **dict(zip(BASE, rest, strict=True))})
        # the first of equally short ones: base units before derived ones
        return min(ways, key=lambda powers: sum(abs(e) for e in powers.values()))

    def same_quantity(self, other: "Unit") -> bool:
        """Whether two units are equal apart from radians, which are ratios of lengths."""
        return self.exponents[:-1] == other.exponents[:-1]


@dataclass(frozen=True, slots=True)
class Scaled:
    """An SI unit, and how to convert to it: SI value = factor * value + offset. 'km/h' has the factor 1/3.6."""

    unit: Unit
    factor: float
    offset: float = 0.0  # not 0 only for temperatures, whose scales have other zeros


@lru_cache(512)
def parse_unit(text: str) -> Unit:
    """Read 'm/s^2', 'N.m', 'rad/s', 'kg/(m.s)', '1'. Raises ValueError naming the part it cannot read."""
    total = Unit((Fraction(0),) * len(BASE))
    for name, power in _factors(text):
        if name not in DERIVED and name not in BASE:
            raise _unreadable(text, name)
        total = total * _si(name) ** power
    return total


def parse_scaled(text: str, wanted: str | None = None) -> Scaled:
    """The same for headings of recordings, which may be 'km/h', 'deg/s', 'kN', 'bar', '%' or empty (a plain number).

    wanted: the expected unit; 'g' is a gram if the expected quantity is then matched, else the standard gravity.
    """
    if text.strip() in TEMPERATURES:
        factor, offset = TEMPERATURES[text.strip()]
        return Scaled(parse_unit("K"), factor, offset)
    if wanted is not None and any(name == "g" for name, _ in _factors(text)):
        grams = _scaled(text, FOREIGN | GRAM)
        if grams.unit.same_quantity(parse_unit(wanted)):
            return grams
    return _scaled(text, FOREIGN)


def _scaled(text: str, foreign: Mapping[str, tuple[str, float]]) -> Scaled:
    unit, factor = Unit((Fraction(0),) * len(BASE)), 1.0
    for name, power in _factors(text):
        if name in foreign:
            of, size = foreign[name]
            unit, factor = unit * parse_unit(of) ** power, factor * size**power
        elif name in DERIVED or name in BASE:
            unit = unit * _si(name) ** power
        else:
            raise _unreadable(text, name, *FOREIGN)
    return Scaled(unit, factor)


def _si(name: str) -> Unit:
    exponents = DERIVED.get(name, {name: 1})
    return Unit(tuple(Fraction(exponents.get(base, 0)) for base in BASE))


def _factors(text: str) -> Iterator[tuple[str, int]]:
    tight = _AROUND.sub(r"\1", text.replace("²", "^2").replace("³", "^3"))
    above, _, below = tight.partition("/")
    for part, sign in ((above, 1), (below.strip("()"), -1)):
        for factor in filter(None, re.split(r"[.*·\s]", part)):
            match = _FACTOR.match(factor)
            if match is None or len(match[2] or "") > POWER_DIGITS:
                raise _unreadable(text, factor)
            yield match[1], sign * int(match[2] or 1)


def _unreadable(text: str, part: str, *more: str) -> ValueError:
    known = ", ".join((*BASE, *DERIVED, *more))
    return ValueError(
        f"unit {text[:SHOWN]!r}: cannot read {part[:SHOWN]!r}; known are {known}, as in 'm/s^2', 'kg/(m.s)'"
    )


def shown(unit: str) -> str:
    """A unit for readers: 'm/s²', 'N·m' for 'N.m' and 'N m'; empty for a plain number."""
    raised = _POWER.sub(lambda power: "²" if power[1] == "2" else "³", unit)
    return "" if unit == "1" else raised.replace(".", "·").replace("*", "·").replace(" ", "·")


CONFUSED = (
    "km/h",
    "deg",
    "deg/s",
    "rpm",
    "g",
    "mm",
    "mm/s",
    "km",
    "ms",
    "kN",
    "kNm",
    "bar",
    "kPa",
    "MPa",
    "%",
    "t",
    "l",
    "l/s",
)


def confusions(si: str) -> dict[str, float]:
    """Mistaken headings of a quantity whose unit is `si`: in words, and how many times too large the numbers are then."""
    unit = parse_unit(si)
    found = {}
    for text in CONFUSED:
        scaled = parse_scaled(text)
        if scaled.unit == unit:
            found[f"{text} under a heading of {si}"] = 1.0 / scaled.factor
            found[f"{si} under a heading of {text}"] = scaled.factor
    return found
