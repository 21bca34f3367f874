"""`loaderhil identify contact`: vertical stiffness and contact patch of a tyre from a sheet of readings."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from identify.make.command import MachineOption
from identify.origin import origin_of

if TYPE_CHECKING:
    from identify.tyre.parameters import Nominal
    from identify.tyre.patch import Fitted

UNITS = {"load": "N", "deflection": "m", "loaded_radius": "m", "length": "m", "width": "m"}
"""Columns of a sheet."""
HEAVIEST = 100.0
"""Load over the nominal one that no reading can have."""
WIDE = 0.1
"""Half of the 95 % interval of a law's value at nominal load, over the value, above which the readings do not determine it."""


def contact(
    readings: Annotated[
        Path,
        typer.Argument(
            metavar="READINGS.csv",
            help="One row per load: load [kN], deflection [mm] or loaded_radius [m], length [mm] and width [mm] of the print. Cells may be empty.",
        ),
    ],
    machine: MachineOption = "l60",
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")] = Path(
        "out/identify"
    ),
) -> None:
    """Vertical stiffness and contact patch of a tyre from static readings: report.html, identification.json, machine.toml.

    Radius and nominal load are those of the machine. The vertical stiffness is what `rig.toml` needs to make loads of piston pressures.
    """
    import json

    from diagnosis.command import write
    from hil.ending import Ending
    from identify.page.contact_page import contact_page
    from identify.results import check_base

    check_base(machine)
    nominal, found, left_out = readings_of(readings, machine)
    warnings = [*left_out, *_warnings(found, nominal)]
    if not found:
        print(f"nothing can be identified: {'; '.join(left_out)}")
        raise typer.Exit(Ending.INCONCLUSIVE)
    origin = origin_of(f"loaderhil identify contact {readings}")
    for f in found.values():
        for which, name in enumerate(f.law.coefficients):
            i = f.interval(which)
            print(f"{name:20} {i.value:12.5g}   95 % {i.lower:.5g} to {i.upper:.5g}")
    for name, (value, half, unit) in at_nominal(found, nominal).items():
        print(f"{name:40} {value:.4g} ± {half:.2g} {unit}")
    for text in warnings:
        print(f"warning: {text}")
    content = {
        "origin": origin,
        "parameters": {
            name: {"value": i.value, "sd": i.sd, "lower": i.lower, "upper": i.upper}
            for f in found.values()
            for which, name in enumerate(f.law.coefficients)
            for i in [f.interval(which)]
        },
        "nominal": {"load_N": nominal.load, "radius_m": nominal.radius},
        "warnings": warnings,
    }
    texts = {
        "report.html": contact_page(
            readings.name, found, at_nominal(found, nominal), warnings=warnings, origin=origin
        ),
        "identification.json": json.dumps(content, indent=1, ensure_ascii=False) + "\n",
    }
    if "deflection" in found:
        texts |= _machine(found["deflection"], machine, out, origin)
    for path in write("--out", out, texts):
        print(f"written: {path}")


def readings_of(file: Path, machine: str) -> tuple["Nominal", dict[str, "Fitted"], list[str]]:
    """What the laws are relative to, the laws through a sheet, and one sentence per column of which none can be made. Raises BadRecording."""
    from identify.reading import BadRecording
    from identify.sheet import read_sheet
    from identify.tyre.parameters import Nominal
    from plant.sheets.machine import load_machine

    sheet = read_sheet(file, UNITS, ("load",), "readings")
    tyre = load_machine(machine).tyre
    nominal = Nominal(load=tyre.nominal_load, pressure=tyre.nominal_pressure * 1e5, radius=tyre.radius)
    try:
        return nominal, *fitted(sheet, nominal)
    except ValueError as error:
        raise BadRecording(f"{file}: {error}") from error


def fitted(sheet: Mapping[str, "Array"], nominal: "Nominal") -> tuple[dict[str, "Fitted"], list[str]]:
    """Every law that the sheet has readings of, and one sentence per column of which no law can be made.

    Raises ValueError for readings that a tyre cannot have.
    """
    import numpy as np

    from identify.tyre.patch import fit, laws

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


def at_nominal(found: Mapping[str, "Fitted"], nominal: "Nominal") -> dict[str, tuple[float, float, str]]:
    """Value, half of its 95 % interval, and unit of what each law says at nominal load."""
    out = {}
    if "deflection" in found:
        f = found["deflection"]
        depth = _depth(f, nominal)
        i, j = f.at(depth), f.slope(depth)
        # the deflection at a given load errs by the load's error over the slope
        out["deflection at nominal load"] = (1e3 * depth, 1e3 * (i.upper - i.value) / j.value, "mm")
        out["vertical stiffness at nominal load"] = (j.value / 1e3, (j.upper - j.value) / 1e3, "kN/m")
    for name in ("length", "width"):
        if name in found:
            i = found[name].at(nominal.load)
            out[f"half {name} at nominal load"] = (1e3 * i.value, 1e3 * (i.upper - i.value), "mm")
    return out


def _depth(f: "Fitted", nominal: "Nominal") -> float:
    """Deflection at nominal load [m]."""
    one, two = f.coefficients.tolist()
    root = max(one * one + 4.0 * two, 0.0) ** 0.5
    return 2.0 * nominal.radius / (one + root)


def _warnings(found: Mapping[str, "Fitted"], nominal: "Nominal") -> list[str]:
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


def _machine(f: "Fitted", base: str, out: Path, origin: str) -> dict[str, str]:
    """The machine on this vertical stiffness."""
    from identify.results import with_tyre

    lines: Sequence[tuple[str, float, str]] = [
        (name, i.value, f"identified, 95 % {i.lower:.4g} to {i.upper:.4g}")
        for which, name in enumerate(f.law.coefficients)
        for i in [f.interval(which)]
    ]
    return {"machine.toml": with_tyre(base, lines, origin)}


if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
