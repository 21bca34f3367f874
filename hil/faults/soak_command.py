"""`loaderhil soak`: hours of lockstep under random faults."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from hil.faults.soak import Soak


def soak(
    hours: Annotated[float, typer.Option("--hours", min=0.005, max=1000.0, help="Simulated time.")] = 1.0,
    seed: Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Of drives and faults.")] = 1,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="Page to write.")] = None,
    realtime: Annotated[
        Path | None,
        typer.Option(
            "--realtime", metavar="DIR", help="As processes over the gateway; its run stays in DIR."
        ),
    ] = None,
) -> None:
    """Random drives under random faults: is each noticed, does the ECU keep its word.

    Fails if the ECU leaves its declared states or ranges, if anything is noticed that nobody had done, or if a process grows.
    Example: `loaderhil soak --hours 1 --seed 1 --out docs/results/soak.md`
    """
    from rich.progress import Progress

    from hil.ending import Ending
    from hil.faults.soak_document import page
    from hil.verdict import Result

    with Progress() as progress:
        task = progress.add_task("soak", total=hours * 3600)
        found = _soaked(hours * 3600, seed, realtime, lambda done_s: progress.update(task, completed=done_s))
    options = (f" --realtime {realtime}" if realtime else "") + (f" --out {out}" if out else "")
    text = page(found, f"loaderhil soak --hours {hours:g} --seed {seed}{options}")
    if out is None:
        print(text)
    else:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
        print(out)
    told = f"{found.violations.count} violations, {found.unexplained.count} unexplained notices"
    print(f"{found.result.value}: {told}")
    raise typer.Exit(Ending.FAILED if found.result is Result.FAILED else Ending.PASSED)


def _soaked(seconds: float, seed: int, realtime: Path | None, progress: Callable[[float], None]) -> "Soak":
    if realtime is None:
        from hil.faults.soak import soak

        return soak(seconds, seed, progress)
    from hil.faults.soak_realtime import soak_realtime

    return soak_realtime(seconds, seed, realtime, progress)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(soak)
