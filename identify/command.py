"""`loaderhil identify`: tyre and machine parameters from raw measurements."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from identify.contact_command import contact
from identify.machine_command import machine_command
from identify.make.command import MachineOption, make_field_command, make_rig_command
from identify.origin import origin_of
from identify.score import score_command

ProfileOption = Annotated[
    bool,
    typer.Option(
        "--profile",
        help="Intervals by profile likelihood for all parameters of the tyre, not only for those of which the curvature of the likelihood says nothing (some ten seconds each).",
    ),
]
OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(
        no_args_is_help=True,
        help="Find tyre and machine parameters in raw measurements, or make such measurements.",
    )
    group.command("rig")(rig)
    group.command("field")(field)
    group.command("contact")(contact)
    group.command("machine")(machine_command)
    group.command("score")(score_command)
    group.command("make-rig")(make_rig_command)
    group.command("make-field")(make_field_command)
    app.add_typer(group, name="identify")


def rig(
    description: Annotated[
        Path,
        typer.Argument(
            metavar="RIG.toml",
            help="Description of the log (runs, loads, calibration), or the folder that contains it.",
        ),
    ],
    out: OutOption = Path("out/identify"),
    machine: MachineOption = "l60",
    dbc: Annotated[
        list[Path] | None, typer.Option("--dbc", metavar="FILE", help="For recordings of CAN frames.")
    ] = None,
    search: Annotated[
        bool,
        typer.Option(
            "--search/--no-search",
            help="Whether a global search (differential evolution) checks the result of the fit (half a minute).",
        ),
    ] = True,
    profile: ProfileOption = False,
) -> None:
    """A tyre from the raw log of a chassis dynamometer: report.html, identification.json, tyre.tir, machine.toml.

    Example: `loaderhil identify make-rig out/rig --seed 1`, then `loaderhil identify rig out/rig/rig.toml --out out/tyre`
    """
    from diagnosis.command import write
    from hil.companions import CALIBRATION
    from hil.ending import Ending
    from identify.machine_text import check_base
    from identify.page.rig_page import rig_page
    from identify.results import as_json, rig_machine, tyre_file
    from identify.rig.chain import (
        BASE,
        OF_BRAKING,
        OF_LOAD,
        OF_LOADS,
        OF_PRESSURE,
        OF_PRESSURES,
        fitted,
        inconsistent_runs,
        lengths,
        prepare,
        problem_of,
        staged,
    )
    from identify.rig.files import read_rig
    from identify.rig.models import compared
    from identify.rig.preparing import Unusable
    from identify.tyre.advice import not_fitted, undetermined
    from identify.tyre.search import searched

    check_base(machine)
    file = description / "rig.toml" if description.is_dir() else description
    log = read_rig(file, dbc or [])
    try:
        ready = prepare(log)
    except Unusable as error:
        print(f"nothing can be identified: {error}")
        raise typer.Exit(Ending.INCONCLUSIVE) from error
    origin = origin_of(f"loaderhil identify rig {description}")
    problem = problem_of(ready)
    stages = staged(ready)
    found = _with_profiles(problem, fitted(ready, stages), every=profile)
    nominal = [
        t
        for t in ready.fitted
        if t.kind in ("drive", "brake")
        and _near(t.inflation, log.nominal.pressure)
        and t.piston_pressure == min(x.piston_pressure for x in ready.fitted)
    ]
    base = tuple(n for n in BASE if n in problem.tyre)
    # the global search costs thousands of evaluations, so it gets four nominal runs and the four basic parameters only
    check = searched(problem_of(ready, base, traces=nominal[:4])) if search and nominal else None
    wanted = (*BASE, *OF_BRAKING, *OF_LOAD, *OF_LOADS, *OF_PRESSURE, *OF_PRESSURES, "PHX1", "PVX1")
    opened = [*undetermined(found, problem), *not_fitted(problem.tyre, wanted)]
    page = rig_page(
        ready,
        problem,
        found,
        stages=stages,
        steps=lengths(ready),
        models=compared(ready),
        search=check,
        opened=opened,
        origin=origin,
    )
    files = rig_machine(ready, found, machine, out / "machine.toml", origin)
    texts = {
        "report.html": page,
        "identification.json": as_json(ready, found, opened, origin),
        "tyre.tir": tyre_file(ready, found, origin),
        "machine.toml": files[out / "machine.toml"],
        f"machine{CALIBRATION}": files[out / f"machine{CALIBRATION}"],
    }
    _print_result(found, opened, [*ready.unusable, *ready.warnings, *inconsistent_runs(ready, found)])
    for path in write("--out", out, texts):
        print(f"written: {path}")
    if check is not None and not check.agree:
        print("fit and global search disagree: the tyre may be wrong")
        raise typer.Exit(Ending.INCONCLUSIVE)


def field(
    description: Annotated[
        Path,
        typer.Argument(
            metavar="FIELD.toml",
            help="Description of both recordings and the ground, or the folder that contains it.",
        ),
    ],
    out: OutOption = Path("out/identify"),
    friction: Annotated[
        float,
        typer.Option(
            "--friction",
            min=0.05,
            max=2.0,
            help="Friction of the surface, used where the slips are too small to identify it: asphalt 0.75, gravel 0.6.",
        ),
    ] = 0.75,
    machine: MachineOption = "l60",
    dbc: Annotated[
        list[Path] | None, typer.Option("--dbc", metavar="FILE", help="For recordings of CAN frames.")
    ] = None,
    profile: ProfileOption = False,
) -> None:
    """A tyre from motion capture and a wheel transducer that share no clock: report.html, identification.json, tyre.tir, machine.toml.

    Example: `loaderhil identify make-field out/field --seed 1`, then `loaderhil identify field out/field/field.toml --out out/tyre`
    """
    import json

    from diagnosis.command import write
    from hil.companions import CALIBRATION
    from hil.ending import Ending
    from identify.field.chain import Unusable, processed
    from identify.field.files import read_field
    from identify.field.fit import fit_points
    from identify.machine_text import check_base
    from identify.page.field_page import field_page
    from identify.results import field_machine, interval_text
    from identify.tyre.advice import not_fitted, undetermined
    from identify.tyre.parameters import COMBINED, INDEX
    from identify.tyre.tir_file import tir_text

    check_base(machine)
    file = description / "field.toml" if description.is_dir() else description
    log = read_field(file, dbc or [])
    try:
        result = processed(log)
    except Unusable as error:
        print(f"nothing can be identified: {error}")
        raise typer.Exit(Ending.INCONCLUSIVE) from error
    problem, found = fit_points(result, friction=friction)
    found = _with_profiles(problem, found, every=profile)
    opened = [
        *undetermined(found, problem),
        *not_fitted(
            problem.tyre, ("PCX1", "PDX1", "PEX1", "PKX1", "PDX2", "PKX3", "PPX1", "PPX3", *COMBINED)
        ),
    ]
    origin = origin_of(f"loaderhil identify field {description}")
    intervals = {n: found.interval(n) for n in found.names}
    s = result.sync
    content = {
        "origin": origin,
        "parameters": {
            n: {"value": i.value, "sd": i.sd, "lower": i.lower, "upper": i.upper, "by": found.by(n)}
            for n, i in intervals.items()
        },
        "clock": {
            "offset_s": s.offset,
            "offset_sd_s": s.offset_sd,
            "drift": s.drift,
            "drift_sd": s.drift_sd,
            "pulse_s": s.by_pulse,
            "lost_events": [i + 1 for i in s.lost],
        },
        "undetermined": {o.name: {"reason": o.reason, "step": o.step} for o in opened},
        "rejected": dict(result.rejected),
        "warnings": list(result.warnings),
    }
    names = [n for n in found.names if n in INDEX or n in COMBINED]
    stiffness = (
        20.0 * log.nominal.load / log.nominal.radius
    )  # not measured, but readers of .tir files require a value
    tir = tir_text(
        {n: found.values[n] for n in names},
        log.nominal,
        vertical_stiffness=stiffness,
        notes={n: interval_text(found, n) for n in names},
        comments=(origin, "VERTICAL_STIFFNESS is not identified"),
    )
    files = field_machine(result, problem, found, machine, out / "machine.toml", origin)
    _print_result(found, opened, result.warnings)
    texts = {
        "report.html": field_page(result, problem, found, opened=opened, origin=origin),
        "identification.json": json.dumps(content, indent=1) + "\n",
        "tyre.tir": tir,
        "machine.toml": files[out / "machine.toml"],
        f"machine{CALIBRATION}": files[out / f"machine{CALIBRATION}"],
    }
    for path in write("--out", out, texts):
        print(f"written: {path}")


def _with_profiles(problem: "RigProblem | PointProblem", found: "Estimate", *, every: bool) -> "Estimate":
    """Intervals by the likelihood itself: of all parameters of the tyre, or of those of which its curvature says nothing."""
    from identify.tyre.profile import with_profiles

    names = [n for n in problem.tyre if every or n in found.free]
    if not names:
        return found
    print(f"profile likelihood of {', '.join(names)} (some ten seconds each)", file=sys.stderr, flush=True)
    return with_profiles(problem, found, names)


def _print_result(found: "Estimate", opened: "Sequence[Open]", warnings: "Sequence[str]") -> None:
    """Intervals of what a user asked for (not of each run's nuisances), what stays open, and warnings."""
    for name in found.names:
        if not name.startswith(("tare ", "scale ", "load ")):
            i = found.interval(name)
            print(f"{name:20} {i.value:12.5g}   95 % {i.lower:.5g} to {i.upper:.5g}")
    for o in opened:
        print(f"not determined: {o.name}: {o.reason}; {o.step}")
    for text in warnings:
        print(f"warning: {text}")


def _near(a: float, b: float) -> bool:
    return abs(a - b) < 0.02 * b


if TYPE_CHECKING:
    from collections.abc import Sequence

    from identify.field.fit import PointProblem
    from identify.tyre.advice import Open
    from identify.tyre.estimate import Estimate
    from identify.tyre.rig_problem import RigProblem
