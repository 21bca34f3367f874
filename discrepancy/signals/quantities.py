"""Numbers with their units as people read them."""

import math

from discrepancy.signals.units import shown

LARGE = 1e4  # of a force, pressure or power, from which a prefix reads better
PLAIN = (-5, 6)  # powers of ten between which a number is written out


def figures(value: float, digits: int = 3) -> str:
    """'1510', '0.0246', '4.84e-07': so many digits, and a power of ten only where zeros would be many."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value + 0.0:g}"
    exponent = math.floor(math.log10(abs(value)))
    if not PLAIN[0] <= exponent < PLAIN[1]:
        return f"{value:.{digits}g}"
    decimals = digits - 1 - exponent
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """'1510 kg', '0.0246': the unit as it is shown, none for a plain number."""
    return f"{figures(value, digits)} {shown(unit)}".rstrip()


def readable(unit: str, largest: float) -> tuple[float, str]:
    """What values up to `largest` are divided by, and the unit they then have: 'MPa' and 'kN' where they would need many digits."""
    text = shown(unit)
    if not text.startswith(("N", "Pa", "W", "J")) or largest < LARGE:
        return 1.0, text
    return (1e6, f"M{text}") if largest >= 1e6 else (1e3, f"k{text}")
