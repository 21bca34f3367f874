"""Static readings of a tyre under several loads: the laws (116) to (118) through them, what these say at nominal load, and what is doubtful."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identify.reading import BadRecording
from identify.sheet import read_sheet
from identify.tyre.parameters import Nominal
from identify.tyre.patch import Fitted, deflection, fit, laws
from plant.sheets.machine import load_machine

Array = NDArray[np.float64]

UNITS: Final = {"load": "N", "deflection": "m", "loaded_radius": "m", "length": "m", "width": "m"}
"""Columns of a sheet."""
HEAVIEST: Final = 100.0
"""Load over the nominal one that no reading can have."""
WIDE: Final = 0.1
"""Half of the 95 % interval of a law's value at nominal load, over the value, above which the readings do not determine it."""


def readings_of(file: Path, machine: str) -> tuple[Nominal, dict[str, Fitted], list[str]]:
    """What the laws are relative to, the laws through a sheet, and one sentence per column of which none can be made. Raises BadRecording."""
    sheet = read_sheet(file, UNITS, ("load",), "readings")
    tyre = load_machine(machine).tyre
    nominal = Nominal(load=tyre.nominal_load, pressure=tyre.nominal_pressure * 1e5, radius=tyre.radius)
    try:
        return nominal, *fitted(sheet, nominal)
    except ValueError as error:
        raise BadRecording(f"{file}: {error}") from error


def fitted(sheet: Mapping[str, Array], nominal: Nominal) -> tuple[dict[str, Fitted], list[str]]:
    """Every law that the sheet has readings of, and one sentence per column of which no law can be made.

    Raises ValueError for readings that a tyre cannot have.
    """
    load = sheet["load"]
    values = {name: v for name, v in sheet.items() if name != "load"}
    if "loaded_radius" in values and "deflection" in values:
        raise ValueError("has both loaded_radius and deflection: one of them follows from the other")
    if "loaded_radius" in values:
        values["deflection"] = nominal.radius - values.pop("loaded_radius")
    if not values:
        raise ValueError(f"has loads alone: a column of {', '.join(list(UNITS)[1:])} is needed")
    found: dict[str, Fitted] = {}
    left_out = []
    for name, value in values.items():
        there = ~np.isnan(value)
        if np.any(~np.isfinite(load)) or np.any(np.isinf(value)):
            raise ValueError(f"a load or {name} is not finite")
        for quantity, numbers in (("load", load[there]), (name, value[there])):
            if np.any(numbers <= 0.0):
                hint = (
                    f"; the unloaded radius of this machine is {nominal.radius:.3f} m"
                    if quantity == "deflection"
                    else ""
                )
                raise ValueError(
                    f"a {quantity} of {float(numbers.min()):g} {UNITS[quantity]} is not above 0{hint}"
                )
        for quantity, numbers, most, what in (
            ("load", load[there], HEAVIEST * nominal.load, f"{HEAVIEST:g} times the nominal load"),
            (name, value[there], 2.0 * nominal.radius, "the diameter of the tyre"),
        ):
            if np.any(numbers > most):
                raise ValueError(
                    f"a {quantity} of {float(numbers.max()):g} {UNITS[quantity]} exceeds {what}: is its unit right?"
                )
        law = laws(nominal)[name]
        x, y = (value[there], load[there]) if name == "deflection" else (load[there], 0.5 * value[there])
        try:
            found[name] = fit(law, x, y)
        except ValueError as error:
            left_out.append(f"{name}: {error}")
    return found, left_out


def at_nominal(found: Mapping[str, Fitted], nominal: Nominal) -> dict[str, tuple[float, float, str]]:
    """Value, half of its 95 % interval, and unit of what each law says at nominal load."""
    out = {}
    if "deflection" in found:
        f = found["deflection"]
        depth = nominal.radius * float(deflection(np.float64(1.0), *f.coefficients.tolist()))
        i, j = f.at(depth), f.slope(depth)
        # the deflection at a given load errs by the load's error over the slope
        out["deflection at nominal load"] = (1e3 * depth, 1e3 * (i.upper - i.value) / j.value, "mm")
        out["vertical stiffness at nominal load"] = (j.value / 1e3, (j.upper - j.value) / 1e3, "kN/m")
    for name in ("length", "width"):
        if name in found:
            i = found[name].at(nominal.load)
            out[f"half {name} at nominal load"] = (1e3 * i.value, 1e3 * (i.upper - i.value), "mm")
    return out


def warnings_of(found: Mapping[str, Fitted], nominal: Nominal) -> list[str]:
    """Sentences on readings that do not reach the nominal load, that a law does not fit, or that determine too little."""
    out = []
    for name, f in found.items():
        loads = f.value if name == "deflection" else f.x
        if not float(loads.min()) <= nominal.load <= float(loads.max()):
            out.append(
                f"{name}: the nominal load of {nominal.load / 1e3:.1f} kN lies outside the readings ({loads.min() / 1e3:.1f} to {loads.max() / 1e3:.1f} kN)"
            )
        if f.constant:
            size = (
                f"{f.constant / 1e3:+.2f} kN at no deflection: is the unloaded radius, or the zero of the deflection, another one?"
                if name == "deflection"
                else f"{2e3 * f.constant:+.1f} mm at no load: was the print measured to its outer edge?"
            )
            out.append(f"{name}: the readings do not follow the law to zero, but lead to {size}")
    for what, (value, half, unit) in at_nominal(found, nominal).items():
        if half > WIDE * abs(value):
            out.append(
                f"{what} is known to ± {half:.2g} {unit} of {value:.3g}: read at four loads or more, over a factor of 3"
            )
    return out
