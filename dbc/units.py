"""Units as DBC files write them, and the SI unit of each, for `dbc.binding`.

SI value = DBC value * factor. Units with an offset (degC) are left out: one factor cannot convert them.
"""

import math

_DEGREE = math.pi / 180

SI: dict[str, tuple[str, float]] = {
    "": ("1", 1.0),
    "1": ("1", 1.0),
    "%": ("1", 0.01),
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "m/s": ("m/s", 1.0),
    "km/h": ("m/s", 1 / 3.6),
    "m/s2": ("m/s2", 1.0),
    "rad": ("rad", 1.0),
    "deg": ("rad", _DEGREE),
    "rad/s": ("rad/s", 1.0),
    "deg/s": ("rad/s", _DEGREE),
    "rpm": ("rad/s", math.tau / 60),
    "N": ("N", 1.0),
    "kN": ("N", 1e3),
    "N.m": ("N.m", 1.0),
    "kN.m": ("N.m", 1e3),
    "Pa": ("Pa", 1.0),
    "kPa": ("Pa", 1e3),
    "kg": ("kg", 1.0),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
}


def factor_to(wanted: str, unit: str) -> float:
    """Factor from the DBC unit `unit` to the SI unit `wanted`; ValueError if they differ in kind."""
    if unit not in SI:
        raise ValueError(f"unit '{unit}' is not known; known are {', '.join(repr(known) for known in SI)}")
    si, factor = SI[unit]
    if si != wanted:
        raise ValueError(
            f"unit '{unit}' converts to {si}, but {wanted} is wanted: was the DBC or the signal changed?"
        )
    return factor
