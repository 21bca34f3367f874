"""What the commands show: progress while a run lasts, tables and verdict lines after it."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from hil.compose import Choice
from hil.ending import Ending
from hil.faults.record import Injected, read_faults
from hil.gateway.buses import ONE_BUS, Buses
from hil.judgement import judge_run, timing_of
from hil.realtime import run_realtime
from hil.realtime_options import RealtimeOptions
from hil.recording.tables import COLOUR, several_channels, table_of
from hil.rundir import RECORD, RunDirectory
from hil.runs import RunResult, run_lockstep
from hil.supervisor import Event
from hil.timing import Spread, Timing, longest_wait_text
from hil.verdict import WHEELS, Result, RunVerdict, Verdict, judge_warning
from hil.vitals import Vitals
from plant.scenario import Scenario, list_scenarios, load_scenario

console = Console(highlight=False)

LATE_SHOWN = 6
"""Messages in the terminal; a late process makes all of its messages late."""


def tell_scenarios(files: Sequence[Path]) -> None:
    """The shipped drive cases, or the ones in `files`: what each needs and what happens."""
    table = Table("scenario", "what happens", box=None, header_style="bold", pad_edge=False)
    table.columns[0].no_wrap = True
    for scenario in [load_scenario(file) for file in files] if files else list_scenarios():
        needs = f"[dim]{scenario.duration_s:g} s, {escape(_needs(scenario))}[/]"
        table.add_row(f"{escape(scenario.name)}\n{needs}", escape(scenario.sentence))
    console.print(table)


def _needs(scenario: Scenario) -> str:
    """What a scenario asks for: its machine, a payload, and what can inject its faults if it has some."""
    needs = [Path(scenario.machine).stem]
    if scenario.payload_mass:
        needs.append(f"{scenario.payload_mass:.0f} kg")
    if Choice(scenario=str(scenario.path)).injector() is not None:
        needs.append("lockstep or a gateway")
    return ", ".join(needs)


def tell_run(
    choice: Choice, out: Path, *, realtime: RealtimeOptions | None, strict: bool, buses: Buses = ONE_BUS
) -> Ending:
    """Run one scenario, show what happened, and say how it ended."""
    result = perform(choice, out, realtime=realtime, title=Path(choice.scenario).stem, buses=buses)
    if result.ending is not Ending.PASSED:
        return result.ending
    run = RunDirectory.read(out)
    seen = judge_run(run)
    table = two_columns()
    add_roll_over_rows(table, [seen])
    verdicts = [judge_warning(seen)] if seen.lifted else []
    if realtime is not None:
        timing = timing_of(run)
        add_timing_rows(table, [timing])
        add_hop_rows(table, [timing])
        add_memory_rows(table, run.record.vitals)
    verdicts += punctual(run)
    console.print(table)
    tell_late_messages(run)
    tell_verdicts(verdicts)
    tell_faults(read_faults(out))
    console.print(f"run directory: {out}")
    return exit_code(verdicts, strict=strict)


def punctual(run: RunDirectory) -> list[Verdict]:
    """Whether a real-time run kept its times: its messages, its ticks."""
    kept = run.record.punctuality
    return [] if kept is None else [kept.frames, kept.ticks]


def tell_late_messages(run: RunDirectory) -> None:
    """The messages that were not in time, those with the most events first."""
    kept = run.record.punctuality
    late = [one for one in kept.messages if one.verdict.events] if kept else []
    if not kept or not late:
        return
    late.sort(key=lambda one: one.verdict.missing + one.verdict.late + one.verdict.early, reverse=True)
    console.print(table_of(late[:LATE_SHOWN], channels=several_channels(kept.messages)))
    if len(late) > LATE_SHOWN:
        console.print(
            f"and {len(late) - LATE_SHOWN} more: {run.path / RECORD}, or the report", soft_wrap=True
        )


def exit_code(verdicts: Sequence[Verdict], *, strict: bool) -> Ending:
    """FAILED if any verdict failed; one that could not be reached fails only when asked to."""
    bad = {Result.FAILED, Result.INCONCLUSIVE} if strict else {Result.FAILED}
    return Ending.FAILED if any(verdict.result in bad for verdict in verdicts) else Ending.PASSED


def perform(
    choice: Choice, out: Path, *, realtime: RealtimeOptions | None, title: str, buses: Buses = ONE_BUS
) -> RunResult:
    """Run with a progress bar, in real time or (None) in lockstep; one that did not end well says why on standard error."""
    duration_s = choice.load().duration_s
    with _bar(title, duration_s) as advance:
        if realtime is not None:
            result = run_realtime(choice, out, _to_progress(advance), buses, realtime)
        else:
            result = run_lockstep(choice, out, advance)
    if result.ending is not Ending.PASSED:
        print(f"loaderhil: {result.reason}", file=sys.stderr)
    return result


@contextmanager
def _bar(title: str, duration_s: float) -> Iterator[Callable[[float], None]]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:5.1f} of {task.total:.1f} s"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(f"{title}: compiling and starting", total=duration_s)
        yield lambda time_s: progress.update(task, description=title, completed=min(time_s, duration_s))


def _to_progress(advance: Callable[[float], None]) -> Callable[[str, Event], None]:
    def on_event(_: str, event: Event) -> None:
        if event["event"] == "progress":
            advance(event["time_s"])

    return on_event


def two_columns(*headings: str) -> Table:
    """A table of named figures with one column per run."""
    return Table("", *(headings or ("",)), box=None, header_style="bold", pad_edge=False)


def add_roll_over_rows(table: Table, runs: Sequence[RunVerdict]) -> None:
    """What happened to the machine, one column per run."""
    rows: dict[str, Callable[[RunVerdict], str]] = {
        "true lift-off": lift_off_text,
        "first warning": lambda run: seconds_text(run.warned_s),
        "warning ahead of lift-off": lambda run: seconds_text(run.lead_s),
        "rolls over (45°) at": lambda run: seconds_text(run.rolled_over_s),
        "largest roll angle": lambda run: f"{run.largest_roll * 57.2958:.1f}°",
        "smallest wheel load": lambda run: f"{100 * run.margin:.0f} % of standing",
        "largest load-transfer ratio": lambda run: f"{run.largest_load_transfer:.2f}",
    }
    for name, cell in rows.items():
        table.add_row(name, *(cell(run) for run in runs))


def lift_off_text(run: RunVerdict) -> str:
    if run.lift_off_s is None or run.lifting_wheel is None:
        return "none"
    return f"{run.lift_off_s:.2f} s, {WHEELS[run.lifting_wheel]}"


def tell_faults(faults: Sequence[Injected]) -> None:
    """What was injected, one line each."""
    for fault in faults:
        until = "the end" if fault.ended_s is None else f"{fault.ended_s:.2f} s"
        struck = f"{fault.struck} frames" if fault.struck else "no frame"
        console.print(
            f"injected     {escape(fault.fault)}: {fault.began_s:.2f} s to {until}, {struck}", soft_wrap=True
        )


def seconds_text(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f} s"


def add_timing_rows(table: Table, timings: Sequence[Timing]) -> None:
    """How the processes kept their times, one column per run."""
    for process in ("plant", "ecu"):
        table.add_row(
            f"{process}: tick starts late, p50 / p99",
            *(_spread(timing.lateness.get(process)) for timing in timings),
        )
        table.add_row(
            f"{process}: execution, p50 / p99",
            *(_spread(timing.execution.get(process)) for timing in timings),
        )
    table.add_row("reaction, p50 / p99", *(_spread(timing.reaction) for timing in timings))
    table.add_row("ticks skipped (plant, ecu)", *(_counts(timing.overruns.values()) for timing in timings))
    table.add_row("frames lost", *(str(timing.dropped) for timing in timings))
    table.add_row("processor time stolen", *(f"{100 * timing.stolen:.1f} %" for timing in timings))
    table.add_row(
        "waited for a processor, worst second",
        *(_longest_wait(timing.worst_waited) for timing in timings),
    )
    table.add_row("kept waiting by the host, longest", *(longest_wait_text(timing) for timing in timings))


def _longest_wait(shares: Mapping[str, float]) -> str:
    name = max(shares, key=lambda name: shares[name], default=None)
    return "–" if name is None else f"{100 * shares[name]:.1f} % ({name})"


def add_memory_rows(table: Table, vitals: Vitals | None) -> None:
    """Resident memory of each process: at its start, at the end, and what it grew by."""
    for life in vitals.lives if vitals else ():
        start, end = life.start_bytes / 2**20, life.end_bytes / 2**20
        table.add_row(
            f"{life.process}: memory, start / end", f"{start:.1f} / {end:.1f} MiB ({end - start:+.1f})"
        )


def add_hop_rows(table: Table, timings: Sequence[Timing]) -> None:
    """The way of a reaction, hop by hop; runs with and without a gateway have different ones."""
    for name in dict.fromkeys(name for timing in timings for name in timing.hops):
        table.add_row(f"  {name}, p50 / p99", *(_spread(timing.hops.get(name)) for timing in timings))


def _spread(spread: Spread | None) -> str:
    if spread is None or spread.count == 0:
        return "–"
    return f"{spread.median * 1e-6:.2f} / {spread.p99 * 1e-6:.2f} ms"


def _counts(values: object) -> str:
    return ", ".join(str(value) for value in values)  # type: ignore[attr-defined]


def tell_verdicts(verdicts: Sequence[Verdict], of: str = "") -> None:
    """One line each: the result, of which run if there are several, the question, the reason."""
    run = f"{escape(of)}: " if of else ""
    for verdict in verdicts:
        colour = COLOUR[verdict.result]
        console.print(
            f"[{colour}]{verdict.result.value:<12}[/] {run}{escape(verdict.question)}: {escape(verdict.reason)}",
            soft_wrap=True,
        )
