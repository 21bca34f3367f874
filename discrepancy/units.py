"""Units as exponents of SI base units, so that every coefficient found carries the unit it must have.

The radian is kept as a unit of its own when printed, and counts as 1 when two units are compared.
"""

import re
from dataclasses import dataclass
from fractions import Fraction

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
}
_FACTOR = re.compile(r"([A-Za-z%1]+)(?:\^(-?\d+))?$")


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
        def write(sign: int) -> list[str]:
            return [
                name if abs(e) == 1 else f"{name}^{abs(e)}"
                for name, e in zip(BASE, self.exponents, strict=True)
                if e * sign > 0
            ]

        above, below = write(1), write(-1)
        if not below:
            return ".".join(above) or "1"
        bottom = below[0] if len(below) == 1 else f"({'.'.join(below)})"
        return f"{'.'.join(above) or '1'}/{bottom}"

    def same_quantity(self, other: "Unit") -> bool:
        """Equal but for radians, which are ratios of lengths."""
        return self.exponents[:-1] == other.exponents[:-1]


def parse_unit(text: str) -> Unit:
    """Read 'm/s^2', 'N.m', 'rad/s', 'kg/(m.s)', '1'. Raises ValueError naming the part it cannot read."""
    above, _, below = text.replace(" ", "").replace("²", "^2").replace("*", ".").partition("/")
    total = Unit((Fraction(0),) * len(BASE))
    for part, sign in ((above, 1), (below.strip("()"), -1)):
        for factor in filter(None, part.split(".")):
            match = _FACTOR.match(factor)
            if match is None or (match[1] not in DERIVED and match[1] not in BASE):
                known = ", ".join((*BASE, *DERIVED))
                raise ValueError(
                    f"unit {text!r}: cannot read {factor!r}; known are {known}, as in 'm/s^2', 'kg/(m.s)'"
                )
            power = sign * int(match[2] or 1)
            exponents = DERIVED.get(match[1], {match[1]: 1})
            total = total * Unit(tuple(Fraction(exponents.get(name, 0) * power) for name in BASE))
    return total
