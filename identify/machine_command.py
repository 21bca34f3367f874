"""`loaderhil identify machine`: parameters of a machine from drives, from weighings, or from both."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diagnosis.options import SheetOption
from diagnosis.sheet import Sheet

if TYPE_CHECKING:
    from diagnosis.reading.reading import ReadOptions
    from discrepancy.model.description import Model
    from discrepancy.signals.recording import Complaint, Recording
    from identify.machine.drives import Build, Identified
    from identify.machine.weighing import Weighed

DEFAULT_OUT = Path("out/identify")


def machine_command(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN|WEIGHINGS.csv...",
            help="Run directories of the bench or tables headed `name [unit]` (several: one joint estimate); a .csv of weighings: "
            "articulation, grade, bank and the four wheel loads, one row per weighing.",
        ),
    ],
    weighing: Annotated[
        Path | None,
        typer.Option(
            "--weighing", metavar="FILE", help="Weighings of the same machine, as a prior of the drives."
        ),
    ] = None,
    machine: Annotated[
        str | None,
        typer.Option(
            "--machine",
            metavar="NAME|FILE",
            help="The sheet to start from; by default that of the runs, else l60.",
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DIR", help="Folder for the results of drives; weighings alone are only printed."
        ),
    ] = DEFAULT_OUT,
    load_sd: Annotated[
        float, typer.Option("--load-sd-N", min=0.1, max=1e5, help="Standard deviation of one scale.")
    ] = 100.0,
    sheet: SheetOption = Sheet.DATASHEET,
    payload_sd: Annotated[
        float,
        typer.Option(
            "--payload-sd-kg",
            min=0.0,
            max=5000.0,
            help="How well the payload of the runs is known; above 0 its error, the same in all runs, is identified too.",
        ),
    ] = 0.0,
    instruments: Annotated[
        bool,
        typer.Option(
            "--instruments/--no-instruments",
            help="Whether channels of the test instruments (wheel forces, joint torque) are used where they were recorded.",
        ),
    ] = True,
    profile: Annotated[
        bool,
        typer.Option(
            "--profile",
            help="Intervals of the machine's parameters by profile likelihood too (some seconds each).",
        ),
    ] = False,
    programme: Annotated[
        bool,
        typer.Option(
            "--programme/--no-programme",
            help="Whether the shortest drive programme is computed: every scenario of the bench is driven once (half a minute).",
        ),
    ] = True,
    target: Annotated[
        float,
        typer.Option(
            "--target",
            min=0.02,
            max=0.98,
            help="Of a parameter's posterior over its prior standard deviation, for the programme.",
        ),
    ] = 0.5,
    dbc: Annotated[
        list[Path] | None, typer.Option("--dbc", metavar="FILE", help="For recordings of CAN frames.")
    ] = None,
    channel: Annotated[
        list[str] | None,
        typer.Option(
            "--channel",
            metavar="NAME=COLUMN",
            help="Column (or CAN `Message.Signal`) of a channel; may be repeated.",
        ),
    ] = None,
) -> None:
    """Masses, centres of gravity, inertias, stiffness, radius and zero points of the sensors from drives: report.html, identification.json, machine.toml. From weighings alone: mass, moments and height.

    Examples: `loaderhil identify machine out/run1 out/run2 --out out/machine`, `loaderhil identify machine weighings.csv --load-sd-N 50`
    """
    weighings = [*([weighing] if weighing is not None else []), *(p for p in paths if is_weighing(p))]
    runs = [p for p in paths if not is_weighing(p)]
    if not runs:
        _print_weighed(weighings, machine or "l60", load_sd)
        return
    from diagnosis.reading.reading import ReadOptions, assigned

    given = assigned(channel or [])
    options = ReadOptions(
        paths=runs, renamed=given.columns, units=given.units, time=given.time, dbcs=dbc or []
    )
    from hil.ending import Ending

    command = f"loaderhil identify machine {' '.join(map(str, paths))}"
    base, build, recordings, complaints = _read(options, machine, sheet, payload_sd, instruments=instruments)
    weighed = _weighed(weighings, base, load_sd) if weighings else None
    found = _identified(base, build, recordings, weighed, complaints)
    _results(found, base, out, command, profile=profile, target=target if programme else None)
    if found.inadequate:
        raise typer.Exit(Ending.INCONCLUSIVE)


def is_weighing(path: Path) -> bool:
    """Whether a file is a table of weighings: a .csv with a column of one."""
    from diagnosis.reading.tables import heading
    from identify.machine.files import ANGLES, LOADS

    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            first = next((row for row in csv.reader(stream) if row and not row[0].startswith("#")), [])
    except (OSError, UnicodeDecodeError, csv.Error):
        return False
    return any(heading(text)[0] in (*ANGLES, *LOADS) for text in first)


def _read(
    options: "ReadOptions", machine: str | None, sheet: Sheet, payload_sd: float, *, instruments: bool
) -> "tuple[str, Build, list[Recording], Sequence[Complaint]]":
    """Name or file of the sheet's machine, the model of the identification, the recordings, and what is wrong with them. Raises a UserError for the first that is unusable."""
    from dataclasses import replace

    from diagnosis.models import find_model
    from diagnosis.reading.origin import base_of
    from diagnosis.reading.reading import Misuse, read_all
    from diagnosis.sheet import with_sheet
    from discrepancy.checks.clocks import with_clocks
    from discrepancy.models.loader.channels import REFERENCE
    from identify.machine.parameters import MOVED, identification_model
    from identify.reading import BadRecording
    from plant.sheets.machine import load_machine

    choice = find_model("loader")
    read = read_all(choice, options, lambda _: None)
    # One drive less would be another estimate than the user asked for, with wider intervals: no drive is left out in silence.
    if broken := [c for c in read.complaints if c.fatal]:
        raise BadRecording(broken[0].described)
    origin = base_of(choice, Path(machine) if machine else None, read.machines)
    base = str(origin.given or choice.own_machine)
    if doubled := [item.effect.name for item in load_machine(base).effects if item.effect.name in MOVED]:
        raise Misuse(
            f"{base}: has [effects.{doubled[0]}], which is identified as a value of its body; write it into the body and remove the effect"
        )

    def build(recordings: "Sequence[Recording]") -> "Model":
        model = choice.build(recordings) if origin.given is None else _from(origin.given, recordings)
        return with_clocks(with_sheet(identification_model(model, payload_sd=payload_sd), sheet), read.clocks)

    recordings = list(read.recordings)
    if not instruments:
        recordings = [
            replace(r, signals={n: s for n, s in r.signals.items() if n not in REFERENCE}) for r in recordings
        ]
    return base, build, recordings, read.complaints


def _from(machine: Path, recordings: "Sequence[Recording]") -> "Model":
    """The loader's model of a machine file."""
    from diagnosis.apply.machine_files import baseline

    return baseline(machine, recordings)


def _weighed(weighings: Sequence[Path], machine: str, load_sd: float) -> "Weighed":
    """The balances of all rows. Exits where they allow none."""
    from hil.ending import Ending
    from identify.machine.files import read_weighings
    from identify.machine.weighing import Geometry, weighed
    from plant.sheets.machine import load_machine

    g = load_machine(machine).geometry
    geometry = Geometry(front=g.front_axle_x, rear=-g.rear_axle_x, track=g.track)
    try:
        return weighed([row for file in weighings for row in read_weighings(file)], geometry, load_sd)
    except ValueError as error:
        print(f"nothing can be identified: {error}")
        raise typer.Exit(Ending.INCONCLUSIVE) from error


def _print_weighed(weighings: Sequence[Path], machine: str, load_sd: float) -> None:
    from identify.ends import NORMAL_95
    from identify.machine.weighing import NAMES, UNITS

    found = _weighed(weighings, machine, load_sd)
    opened = dict(found.undetermined)
    for name, unit, value, sd in zip(NAMES[:5], UNITS, found.value, found.sd, strict=False):
        if name not in opened:
            print(
                f"{name:16} {value:12.5g} {unit:5}  95 % {value - NORMAL_95 * sd:.5g} to {value + NORMAL_95 * sd:.5g}"
            )
    if "height moment" not in opened:
        print(f"{'height':16} {found.height:12.4g} m")
    for name, step in opened.items():
        print(f"not determined: {name}: {step}")
    print(
        "not determined: mass of each frame by itself, inertias: weighings at rest determine first moments only; weigh one frame alone, or record turns with yaw rate and forces"
    )
    for number in found.odd:
        print(f"warning: weighing {number} does not fit the others: is its angle or a load wrong?")


def _identified(
    base: str,
    build: "Build",
    recordings: "Sequence[Recording]",
    weighed: "Weighed | None",
    complaints: "Sequence[Complaint]",
) -> "Identified":
    """The estimate. Exits where the recordings allow none."""
    from rich.console import Console

    from diagnosis.describe import counted
    from diagnosis.progress import shown_progress
    from discrepancy.estimation.problem import Unusable
    from hil.ending import Ending
    from identify.machine.balances import weighed_prior
    from identify.machine.drives import identified
    from plant.sheets.machine import load_machine

    machine = load_machine(base)
    prior = None if weighed is None else weighed_prior(machine, build(recordings), weighed)
    try:
        with shown_progress(Console(stderr=True)) as progress:
            progress(f"fitting the machine to {counted(len(recordings), 'drive')}")
            return identified(machine, build, recordings, prior, complaints)
    except Unusable as error:
        print(f"nothing can be identified: {error}")
        raise typer.Exit(Ending.INCONCLUSIVE) from error


def _results(
    found: "Identified", base: str, out: Path, command: str, *, profile: bool, target: float | None
) -> None:
    """All files, and the table on the terminal; target: of the drive programme, None for none."""
    from rich.console import Console

    from diagnosis.command import write
    from diagnosis.progress import shown_progress
    from identify.ends import ProfileInterval
    from identify.machine.profile import profiles
    from identify.machine.programme import drives, shortest
    from identify.machine.results import (
        as_json,
        machine_files,
        programme_lines,
        together,
        undetermined,
        warnings,
    )
    from identify.origin import origin_of
    from identify.page.machine_page import machine_page

    origin = origin_of(command)
    machine = machine_files(found, base, out / "machine.toml", origin)
    written = write("--out", out, {path.name: text for path, text in machine.items()})
    own = tuple(e.quantity.parameter for e in found.estimates if e.quantity.kind == "machine")
    checked: Mapping[str, ProfileInterval] = {}
    programme = None
    with shown_progress(Console(stderr=True)) as progress:
        if profile:
            progress(f"profile likelihood of {len(own)} parameters")
            checked = profiles(found, own)
        if target is not None:
            candidates, left_out = drives(found, out / "machine.toml", progress)
            programme = shortest(found, candidates, left_out, target)
    written += write("--out", out, {
        "report.html": machine_page(found, checked, programme, origin=origin),
        "identification.json": as_json(found, checked, programme, origin),
    })  # fmt: skip
    _print_table(found)
    for name, p in checked.items():
        print(
            f"profile likelihood: {name}: ends differ from the linear ones by {p.asymmetry:.0%} of half the interval"
        )
    for text in together(found):
        print(text)
    for text in undetermined(found):
        print(f"not determined by these drives: {text}")
    for text in programme_lines(found, programme) if programme is not None else ():
        print(text)
    for text in warnings(found):
        print(f"warning: {text}")
    for path in written:
        print(f"written: {path}")


def _print_table(found: "Identified") -> None:
    """Estimates with intervals, beside the sheet and its prior; then the misfit by channel."""
    from rich.console import Console
    from rich.table import Table

    from identify.ends import NORMAL_95
    from identify.machine.results import interval_text

    shown = Table(
        "parameter",
        "value",
        "95 % interval",
        "unit",
        "sheet",
        "prior, 95 %",
        "posterior/prior sd",
        "by these drives",
    )
    for e in found.estimates:
        low, high = interval_text(e)
        prior = f"{e.prior[0]:.4g} to {e.prior[1]:.4g}"
        shown.add_row(
            e.quantity.label,
            f"{e.value:.5g}",
            f"{low} to {high}",
            e.quantity.unit,
            f"{e.sheet:.5g}",
            prior,
            f"{e.remaining:.2f}",
            e.status,
        )
    for name, unit, value, sd in found.sums:
        shown.add_row(
            name,
            f"{value:.5g}",
            f"{value - NORMAL_95 * sd:.5g} to {value + NORMAL_95 * sd:.5g}",
            unit,
            "",
            "",
            "",
            "",
        )
    misfit = Table("channel", "one-step error", "error of the simulation", "budget", "unit", "")
    for c in found.channels:
        misfit.add_row(
            c.channel,
            f"{c.one_step:.3g}",
            f"{c.simulated:.3g}",
            f"{c.simulated_budget:.3g}",
            c.unit,
            "" if c.adequate else "beyond",
        )
    # a pipe has no width: the table must not be folded to 80 columns there
    console = Console(width=None if Console().is_terminal else 200)
    console.print(shown)
    console.print(misfit)
