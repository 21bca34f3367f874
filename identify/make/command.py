"""`loaderhil identify make-rig|make-field`: raw measurements made from the plant, with the defects of the thesis."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

SeedOption = Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of all random numbers.")]
WithoutOption = Annotated[
    list[str] | None,
    typer.Option(
        "--without",
        metavar="DEFECT",
        help="Switch this defect off; may be repeated. 'all' gives a clean recording.",
    ),
]
FormatOption = Annotated[str, typer.Option("--format", metavar="KIND", help="parquet, csv or mat.")]
MachineOption = Annotated[
    str,
    typer.Option(
        "--machine", metavar="NAME|FILE", help="The machine whose tyre is measured, or that gets the result."
    ),
]


def make_rig_command(
    out: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder for rig.toml, its runs and truth.sealed.")
    ],
    seed: SeedOption = 0,
    machine: MachineOption = "l60",
    without: WithoutOption = None,
    kind: FormatOption = "parquet",
) -> None:
    """The raw log of a rig, made from the plant's tyre with the protocol and the defects of the thesis; the truth is sealed in a separate file.

    Defects: spikes, oscillation (15 Hz), dropouts, gain, tare, noise, calibration. Example: `loaderhil identify make-rig out/rig --seed 1 --without spikes`
    """
    from dataclasses import asdict

    from diagnosis.blind.hidden import Truth
    from diagnosis.blind.seal import seal
    from diagnosis.command import write
    from identify.make.defects import RIG
    from identify.make.rig import make_rig
    from identify.rig.files import write_rig
    from identify.writing import FORMATS
    from plant.sheets.machine import load_machine

    _check_format(kind, FORMATS)
    defects = _defects(RIG, without)
    log, truth = make_rig(load_machine(machine), seed, defects)
    files = write_rig(log, out, kind)
    hidden = asdict(truth)
    effects = {
        "tyre": truth.tyre,
        "rig": {k: v for k, v in hidden.items() if isinstance(v, float)},
        "loads": truth.loads,
        "tares": truth.tares,
    }
    [sealed] = write(
        "DIR", out, {"truth.sealed": seal(Truth(model="identify rig", seed=seed, effects=effects), files)}
    )
    print(f"written: {files[0]} and {len(files) - 1} runs\nwritten: {sealed}")


def make_field_command(
    out: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder for field.toml, its recordings and truth.sealed.")
    ],
    seed: SeedOption = 0,
    machine: MachineOption = "l60",
    without: WithoutOption = None,
    kind: FormatOption = "parquet",
    slip_angle: Annotated[
        float,
        typer.Option(
            "--slip-angle",
            metavar="DEG",
            min=0.0,
            max=20.0,
            help="Adds 16 events with the wheel turned against its path, by up to this angle [°]: they determine combined slip.",
        ),
    ] = 0.0,
) -> None:
    """Raw recordings of a field test, made from the plant's tyre with every defect of the thesis; the truth is sealed in a separate file.

    Defects: no_pulse, drift, delay, duplicates, uneven, wrap, spikes, oscillation (15 Hz), dropouts, lost_event, gain, tare, radius, heading, noise.
    Example: `loaderhil identify make-field out/field --seed 1 --without no_pulse`
    """
    import math

    from diagnosis.blind.hidden import Truth
    from diagnosis.blind.seal import seal
    from diagnosis.command import write
    from identify.field.files import write_field
    from identify.make.defects import FIELD
    from identify.make.field import make_field
    from identify.writing import FORMATS
    from plant.sheets.machine import load_machine

    _check_format(kind, FORMATS)
    log, truth = make_field(
        load_machine(machine), seed, _defects(FIELD, without), slip_angle=math.radians(slip_angle)
    )
    files = write_field(log, out, kind)
    clock = {
        "offset": truth.offset,
        "drift": truth.drift,
        "lost_event": float(truth.lost_event),
        "gain": truth.gain,
        "tare": truth.tare,
    }
    [sealed] = write(
        "DIR",
        out,
        {
            "truth.sealed": seal(
                Truth(model="identify field", seed=seed, effects={"tyre": truth.tyre, "measurement": clock}),
                files,
            )
        },
    )
    print(f"written: {files[0]}, {files[1].name}, {files[2].name}\nwritten: {sealed}")


def _check_format(kind: str, known: tuple[str, ...]) -> None:
    if kind not in known:
        raise typer.BadParameter(f"'{kind}' is none of {', '.join(known)}", param_hint="--format")


def _defects(known: tuple[str, ...], without: list[str] | None) -> "Defects":
    """All defects except those that are switched off. Raises typer.BadParameter for an unknown name."""
    from identify.make.defects import chosen

    try:
        return chosen(known, [*known] if without == ["all"] else without or [])
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--without") from error


if TYPE_CHECKING:
    from identify.make.defects import Defects
