"""Formats numbers with units for readers."""

import math

from discrepancy.signals.units import shown

LARGE = 1e4  # force, pressure, power or energy above which a prefix (k, M) reads better
PLAIN = (-5, 6)  # exponents between which a number is written without a power of ten
HOUR_S, DAY_S = 3600.0, 86400.0
IN_HOURS_S, IN_DAYS_S = 2.0 * HOUR_S, 2.0 * DAY_S  # times from which on nobody reads seconds
DATES_S = 1e8  # stamps from here on count from 1970: hours of them say nothing


def figures(value: float, digits: int = 3) -> str:
    """A number with `digits` significant digits: '1510', '0.0246'; with a power of ten only outside of PLAIN: '4.84e-07'."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value + 0.0:g}"
    exponent = math.floor(math.log10(abs(value)))
    if not PLAIN[0] <= exponent < PLAIN[1]:
        return f"{value:.{digits}g}"
    decimals = digits - 1 - exponent
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A number with its unit, none for a plain number: '1510 kg', '0.0246'."""
    return f"{figures(value, digits)} {shown(unit)}".rstrip()


def readable(unit: str, largest: float) -> tuple[float, str]:
    """The divisor for values up to `largest`, and the unit after the division: (1e6, 'MPa'), (1.0, 'm')."""
    text = shown(unit)
    if not text.startswith(("N", "Pa", "W", "J")) or largest < LARGE:
        return 1.0, text
    return (1e6, f"M{text}") if largest >= 1e6 else (1e3, f"k{text}")


def span(start_s: float, end_s: float) -> str:
    """'13.3 to 14.0 s', '46412.3 to 46415.1 s (12.8923 to 12.8931 h)': as many decimals as the length needs, also where stamps count from midnight."""
    text = f"{_ends(start_s, end_s)} s"
    if not IN_HOURS_S <= end_s < DATES_S:
        return text
    size, unit = (HOUR_S, "h") if end_s < IN_DAYS_S else (DAY_S, "d")
    return f"{text} ({_ends(start_s / size, end_s / size)} {unit})"


def _ends(start: float, end: float) -> str:
    """Both ends, to a tenth of their distance."""
    decimals = min(max(1 - math.floor(math.log10(max(end - start, 1e-9))), 0), 4)
    return f"{start:.{decimals}f} to {end:.{decimals}f}"
