"""`loaderhil soak`: hours of lockstep under random faults."""

from pathlib import Path
from typing import Annotated

import typer


def soak(
    hours: Annotated[float, typer.Option("--hours", min=0.005, max=1000.0, help="Simulated time.")] = 1.0,
    seed: Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Of drives and faults.")] = 1,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="Page to write.")] = None,
) -> None:
    """Random drives under random faults in lockstep: is each noticed, does the ECU keep its word.

    Fails if the ECU leaves its declared states or ranges, or if anything is noticed that nobody had done.
    Example: `loaderhil soak --hours 1 --seed 1 --out docs/results/soak.md`
    """
    from rich.progress import Progress

    from hil.ending import Ending
    from hil.faults import soak as work
    from hil.faults.soak_document import page

    with Progress() as progress:
        task = progress.add_task("soak", total=hours * 3600)
        found = work.soak(hours * 3600, seed, lambda done_s: progress.update(task, completed=done_s))
    told = f" --out {out}" if out is not None else ""
    text = page(found, f"loaderhil soak --hours {hours:g} --seed {seed}{told}")
    if out is None:
        print(text)
    else:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
        print(out)
    if not found.passed:
        print(
            f"loaderhil: {found.violations.count} violations, {found.unexplained.count} unexplained notices"
        )
    raise typer.Exit(Ending.PASSED if found.passed else Ending.FAILED)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(soak)
