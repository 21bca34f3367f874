"""The terminal of the bench's commands, and a run with a progress bar."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from hil.compose import Choice
from hil.ending import Ending
from hil.gateway.buses import ONE_BUS, Buses
from hil.processes.supervisor import Event
from hil.runs import RunResult, run_lockstep
from hil.shell.realtime_options import RealtimeOptions

# no highlighting: rich would colour every number and path of a sentence
console = Console(highlight=False)


def run_with_progress(
    choice: Choice,
    out: Path,
    *,
    realtime: RealtimeOptions | None,
    title: str,
    buses: Buses = ONE_BUS,
    quiet: bool = False,
) -> RunResult:
    """Run with a progress bar, in real time, or in lockstep if `realtime` is None. The reason of a bad end goes to standard error.

    quiet: the bar goes to standard error too, because standard output holds JSON.
    """
    duration_s = choice.load().duration_s
    # standard output has to stay one JSON object, so that the bar needs a console of its own
    on = Console(stderr=True) if quiet else console
    with _bar(title, duration_s, on) as advance:
        if realtime is not None:
            # imported here: a run in lockstep needs neither supervisor nor histograms, a tenth of its start
            from hil.processes.realtime import run_realtime

            result = run_realtime(choice, out, _shown(advance, on), buses, realtime)
        else:
            result = run_lockstep(choice, out, advance)
    if result.ending is not Ending.PASSED:
        print(f"loaderhil: {result.reason}", file=sys.stderr)
    return result


@contextmanager
def _bar(title: str, duration_s: float, on: Console) -> Iterator[Callable[[float], None]]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:5.1f} of {task.total:.1f} s"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=on) as progress:
        # the first run after a change compiles for a minute: without these words it looks stuck
        task = progress.add_task(f"{title}: compiling and starting", total=duration_s)
        # the plant's last tick may be a little beyond the duration: the bar must not exceed its end
        yield lambda time_s: progress.update(task, description=title, completed=min(time_s, duration_s))


def _shown(advance: Callable[[float], None], on: Console) -> Callable[[str, Event], None]:
    def on_event(_: str, event: Event) -> None:
        if event["event"] == "progress":
            advance(event["time_s"])
        elif event["event"] == "note":
            # notes hold paths and signal names in brackets, which rich would read as markup
            on.print(escape(event["message"]), soft_wrap=True)

    return on_event
