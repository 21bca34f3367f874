"""`loaderhil model new`: writes a commented model file from the columns of a table. It runs at once, and its author edits it."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from diagnosis.reading.tables import Column, Unreadable, read_table
from discrepancy.signals.units import Scaled, parse_scaled, parse_unit

CAUSES: Final = [
    "command",
    "demand",
    "voltage",
    "current",
    "torque",
    "force",
    "throttle",
    "brake",
    "pedal",
    "power",
    "duty",
    "valve",
    "pump",
    "inflow",
    "input",
    "reference",
    "setpoint",
    "steering",
    "heater",
]
"""Words in the names of columns that usually drive a system; all other columns are taken as its outputs."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A column of the table as a channel of the model."""

    name: str  # a Python name
    column: str  # heading in the table, without its unit
    unit: str  # SI
    typical: float  # a tenth of the spread [unit]
    known_unit: bool  # whether the heading states the unit


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(
        help="Write a model of your own, `model new TABLE --out model.py`, or use an FMU, `model describe FILE.fmu`.",
        no_args_is_help=True,
    )
    group.command("new")(new)
    group.command("describe")(describe)
    app.add_typer(group, name="model")


def new(
    table: Annotated[Path, typer.Argument(metavar="TABLE", help="A recording: .csv, .csv.gz or .parquet.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.py", help="The model file to write.")],
) -> None:
    """Write a commented skeleton of a model from a table's columns. It runs at once and is yours to edit.

    Example: `loaderhil model new drive.csv --out drive.py`, then `loaderhil diagnose drive.csv --model drive.py`
    """
    from diagnosis.command import Unwritable, print_written, write

    if out.suffix != ".py":
        raise Unwritable(f"--out {out}: must end in .py")
    if out.exists():
        raise Unwritable(f"--out {out}: exists already; it is not overwritten")
    print_written(write("--out", out.parent, {out.name: skeleton(table)}))
    print(f"try: loaderhil diagnose {table} --model {out}")


def describe(
    fmu: Annotated[
        Path, typer.Argument(metavar="FILE.fmu", help="An FMU for co-simulation, FMI 2.0 or 3.0.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.toml", help="Also write a commented companion file here."),
    ] = None,
) -> None:
    """Show the variables of an FMU and how a diagnosis would use them, and write its companion file.

    Example: `loaderhil model describe machine.fmu --out machine.toml`
    """
    from diagnosis.command import Unwritable, print_written, write
    from fmi.skeleton import companion_text, lines_of

    if out is not None and (out.suffix != ".toml" or out.exists()):
        raise Unwritable(f"--out {out}: must end in .toml, and an older file is not overwritten")
    for line in lines_of(fmu):
        print(line)
    if out is not None:
        print_written(write("--out", out.parent, {out.name: companion_text(fmu)}))


def skeleton(table: Path) -> str:
    """The text of the model file. Raises Unreadable for a table without a time or without two columns of numbers."""
    columns = [c for c in read_table(table).columns if np.isfinite(c.value).sum() > 1]
    if not columns:
        raise Unreadable(f"{table.name}: has no column of numbers beside the time")
    channels = _channels(columns)
    inputs = [c for c in channels if any(word in c.column.lower() for word in CAUSES)]
    # A model without inputs would predict a constant: take the first column, and let the author correct it.
    if not inputs and len(channels) > 1:
        inputs = channels[:1]
    outputs = [c for c in channels if c not in inputs] or [inputs.pop()]
    step_s = float(np.median(np.diff(columns[0].time_s)))
    return _text(table.name, inputs, outputs, step_s)


def _channels(columns: list[Column]) -> list[Channel]:
    """Columns as channels with names that Python accepts, each name once."""
    found: dict[str, Channel] = {}
    for column in columns:
        name = re.sub(r"\W+", "_", column.name).strip("_").lower() or "channel"
        name = f"c_{name}" if name[0].isdigit() else name
        while name in found:
            name += "_"
        try:
            scaled = parse_scaled(column.unit or "1")
        except ValueError as error:
            raise Unreadable(f"{column.name}: {error}") from error
        spread = float(np.nanstd(column.value)) * scaled.factor
        typical = float(f"{0.1 * spread or 1.0:.1g}")
        found[name] = Channel(
            name, column.name, _si(column.unit or "1", scaled), typical, column.unit is not None
        )
    return list(found.values())


def _si(text: str, scaled: Scaled) -> str:
    """The SI unit of a heading, as it is written there where that is SI already: 'V', not 'kg.m^2/(s^3.A)'."""
    try:
        return text if parse_unit(text) == scaled.unit and scaled.factor == 1.0 else str(scaled.unit)
    except ValueError:
        return str(scaled.unit)


def _per(above: str, below: str, power: int = 1) -> str:
    """The unit of a coefficient: 'm/V', 'm/V^2'; in base units where the short form would be ambiguous."""
    exact = parse_unit(above) / parse_unit(below) ** power
    short = f"{above}/{below}" + (f"^{power}" if power > 1 else "")
    plain = not set("/.^() ") & set(above + below) and "1" not in (above, below)
    return short if plain and parse_unit(short) == exact else str(exact)


def _units(channels: list[Channel]) -> str:
    return "".join(
        f'        "{c.name}": "{c.unit}",{"" if c.known_unit else "  # the heading has no unit: write it here"}\n' for c in channels
    )  # fmt: skip


def _text(table: str, inputs: list[Channel], outputs: list[Channel], step_s: float) -> str:
    terms = {
        o.name: " + ".join(f'values["{o.name}_per_{i.name}"] * window["{i.name}"]' for i in inputs)
        for o in outputs
    }
    simulated = "".join(
        f'        "{o.name}": lagged(values["{o.name}_offset"] + {terms[o.name] or "0.0 * window.time_s"}, values["{o.name}_time_constant"], window.step_s),\n'
        for o in outputs
    )
    nuisances = "".join(
        f'        Parameter(name="{o.name}_time_constant", unit="s", value={5 * step_s:.2g}, lower={0.01 * step_s:.2g}, upper={1e4 * step_s:.2g}, '
        f"typical={step_s:.2g}),\n"
        f'        Parameter(name="{o.name}_offset", unit="{o.unit}", typical={o.typical:g}),\n'
        + "".join(
            f'        Parameter(name="{o.name}_per_{i.name}", unit="{_per(o.unit, i.unit)}", typical={o.typical / i.typical:.1g}),\n'
            for i in inputs
        )
        for o in outputs
    )
    faults = "".join(
        f'        *sensor_effects("{o.name}", "{o.unit}", bias={o.typical:g}, kinds=("scale", "delay")),\n' for o in outputs
    )  # fmt: skip
    columns = "".join(
        f'        "{c.name}": "{c.column}",\n' for c in (*inputs, *outputs) if c.name != c.column
    )
    effect = _example(inputs[0], outputs[0]) if inputs else ""
    added = (
        f'    found["{outputs[0].name}"] = found["{outputs[0].name}"] + values.get("quadratic", 0.0) * window["{inputs[0].name}"] ** 2\n'
        if inputs
        else ""
    )
    return f'''"""A model of {table}. Written by `loaderhil model new`; edit it until it is your model of the system.

    loaderhil diagnose {table} --model THIS_FILE --out out/first

The guesses to check first: which columns are inputs, their units, and the equation in `simulate`. How to go on: docs/howto/write-a-model.md.
"""

from discrepancy.model import Effect, Model, Parameter, lagged, sensor_effects


def simulate(window, values, extra):
    """Outputs on the even grid window.time_s, of inputs window["name"] and parameters values["name"], all in SI."""
    # The guess: every output follows the inputs in proportion, with one lag. Put your equations here. An integrator needs a start
    # value: give it as a Parameter with scope="window" and guess=lambda window: window.at_start("name").
    found = {{
{simulated}    }}
    # The term of an effect. values.get(..., 0.0) keeps it off where the effect is not in the library.
{added}    return found


model = Model(
    name="{re.sub(chr(92) + "W+", " ", table.split(".")[0]).strip() or "model"}",
    sentence="one sentence that describes the model",
    inputs={{
{_units(inputs)}    }},
    outputs={{
{_units(outputs)}    }},
    # Column names in recordings, where they differ from the channel names.
    columns={{
{columns}    }},
    # Parameters whose values are not exactly known; every comparison refits them. prior_sd=... states how well one is known.
    nuisances=(
{nuisances}    ),
    # Effects that may be missing: physics (off while its parameter has its default value) and sensor faults.
    effects=(
{effect}{faults}    ),
    simulate=simulate,
    step_s={step_s:.6g},  # of the grid; the recording's own step is a good start
)
'''


def _example(drive: Channel, output: Channel) -> str:
    """An effect that adds the square of the first input to the first output."""
    unit = _per(output.unit, drive.unit, 2)
    return f'''        Effect(
            name="quadratic",
            sentence="{output.column} also follows the square of {drive.column}",
            equation="y = y_linear + c u²",
            parameters=(Parameter(name="quadratic", unit="{unit}", typical={output.typical / drive.typical**2:.1g}),),
            kind="physics",
            place="{output.column}",
            excited_by="a wide range of {drive.column}",
        ),
'''
