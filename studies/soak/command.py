"""`loaderhil soak`: hours of lockstep under random faults."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from hil.results import Suite
    from studies.soak.soak import Soak


def soak(
    hours: Annotated[float, typer.Option("--hours", min=0.005, max=1000.0, help="Simulated time.")] = 1.0,
    seed: Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of drives and faults.")] = 1,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="Page to write.")] = None,
    realtime: Annotated[
        Path | None,
        typer.Option(
            "--realtime",
            metavar="DIR",
            help="In real time, as processes over the gateway; the run directory is kept in DIR.",
        ),
    ] = None,
    json_output: Annotated[
        bool, typer.Option("--json", help="The results as one JSON object on standard output.")
    ] = False,
    junit: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="The results also as JUnit XML.")
    ] = None,
) -> None:
    """Test the ECU with random faults in random drives: is every fault detected, and do states and outputs stay as declared?

    Fails if the ECU leaves its declared states or ranges, if something is detected without a fault, or if the memory of a process grows.
    Example: `loaderhil soak --hours 1 --seed 1 --out docs/results/soak.md`
    """
    # imported here, because every command of the program loads this module and compiled code takes seconds to import
    from rich.console import Console
    from rich.progress import Progress

    from hil.ending import Ending
    from hil.results import as_json, write_junit
    from hil.verdict import Result
    from studies.soak.document import page

    # standard output belongs to the JSON object
    with Progress(console=Console(stderr=json_output)) as progress:
        task = progress.add_task("soak", total=hours * 3600)
        found = _soaked(hours * 3600, seed, realtime, lambda done_s: progress.update(task, completed=done_s))
    options = (f" --realtime {realtime}" if realtime else "") + (f" --out {out}" if out else "")
    text = page(found, f"loaderhil soak --hours {hours:g} --seed {seed}{options}")
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
    # inconclusive ends with 0: a starved host says nothing against the ECU, and the page names the doubt
    ending = Ending.FAILED if found.result is Result.FAILED else Ending.PASSED
    if junit is not None:
        write_junit(junit, "soak", [suite_of(found)])
    if json_output:
        print(as_json("soak", ending, [suite_of(found)]))
    else:
        print(text if out is None else out)
        summary = f"{found.violations.count} violations, {found.unexplained.count} unexplained detections"
        print(f"{found.result.value}: {summary}")
    raise typer.Exit(ending)


def suite_of(found: "Soak") -> "Suite":
    """The questions of a soak as test cases; a question without an answer (a starved host) does not fail the soak."""
    from hil.results import Case, Suite
    from hil.verdict import Result

    kept, explained = found.violations.count == 0, found.unexplained.count == 0
    cases = [
        Case(
            name="the ECU keeps to its declared states and ranges",
            # a run that never started has no violations either
            result=Result.PASSED if kept and found.simulated_s > 0 else Result.FAILED,
            reason=f"{found.violations.count} violations in {found.simulated_s:.0f} s",
        ),
        Case(
            name="nothing is detected without a fault",
            result=Result.PASSED if explained else Result.INCONCLUSIVE if found.doubt else Result.FAILED,
            reason=f"{found.unexplained.count} unexplained detections"
            + (f"; {found.doubt}" if found.doubt else ""),
            decides=False,
        ),
    ]
    if found.memory is not None:
        cases.append(Case.of(found.memory, decides=False))
    return Suite(name=f"seed {found.seed}", cases=tuple(cases), time_s=found.simulated_s)


def _soaked(seconds: float, seed: int, realtime: Path | None, progress: Callable[[float], None]) -> "Soak":
    if realtime is None:
        from studies.soak.soak import soak

        return soak(seconds, seed, progress)
    from studies.soak.realtime import soak_realtime

    return soak_realtime(seconds, seed, realtime, progress)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(soak)
