"""`loaderhil identify contact`: vertical stiffness and contact patch of a tyre from a sheet of readings."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from identify.make.command import MachineOption
from identify.origin import origin_of

if TYPE_CHECKING:
    from identify.tyre.patch import Fitted


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
    from identify.contact import at_nominal, readings_of, warnings_of
    from identify.machine_text import check_base
    from identify.page.contact_page import contact_page

    check_base(machine)
    nominal, found, left_out = readings_of(readings, machine)
    warnings = [*left_out, *warnings_of(found, nominal)]
    if not found:
        print(f"nothing can be identified: {'; '.join(left_out)}")
        raise typer.Exit(Ending.INCONCLUSIVE)
    origin = origin_of(f"loaderhil identify contact {readings}")
    for f in found.values():
        for which, name in enumerate(f.law.coefficients):
            i = f.interval(which)
            print(f"{name:20} {i.value:12.5g}   95 % {i.lower:.5g} to {i.upper:.5g}")
    said = at_nominal(found, nominal)
    for name, (value, half, unit) in said.items():
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
        "report.html": contact_page(readings.name, found, said, warnings=warnings, origin=origin),
        "identification.json": json.dumps(content, indent=1, ensure_ascii=False) + "\n",
    }
    if "deflection" in found:
        texts |= _machine(found["deflection"], machine, out, origin)
    for path in write("--out", out, texts):
        print(f"written: {path}")


def _machine(f: "Fitted", base: str, out: Path, origin: str) -> dict[str, str]:
    """The machine on this vertical stiffness."""
    from identify.machine_text import with_tyre

    lines = [
        (name, i.value, f"identified, 95 % {i.lower:.4g} to {i.upper:.4g}")
        for which, name in enumerate(f.law.coefficients)
        for i in [f.interval(which)]
    ]
    return {"machine.toml": with_tyre(base, lines, origin)}
