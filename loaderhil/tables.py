"""Formats tables for the terminal: the scenarios, and the figures of one or more runs side by side."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from hil.compose import Choice
from hil.timing.measured import Spread, Timing, longest_wait_text
from hil.timing.vitals import Vitals
from hil.verdict import WHEELS, RunVerdict
from loaderhil.console import console
from plant.unit.scenario import Scenario, list_scenarios, load_scenario


def show_scenarios(files: Sequence[Path]) -> None:
    """Print the scenarios of loaderhil, or those in `files`: content and requirements of each."""
    table = Table("scenario", "what happens", box=None, header_style="bold", pad_edge=False)
    table.columns[0].no_wrap = True
    # loading is the check: a faulty file ends here with its line and key
    for scenario in [load_scenario(file) for file in files] if files else list_scenarios():
        needs = f"[dim]{scenario.duration_s:g} s, {escape(_needs(scenario))}[/]"
        table.add_row(f"{escape(scenario.name)}\n{needs}", escape(scenario.sentence))
    console.print(table)


def _needs(scenario: Scenario) -> str:
    """What a scenario needs: its machine, its payload, and, if it has faults, a mode of running that can inject them."""
    needs = [Path(scenario.machine).stem]
    if scenario.payload_mass:
        needs.append(f"{scenario.payload_mass:.0f} kg")
    # on one bus in real time nothing could inject them
    if Choice(scenario=str(scenario.path)).injector() is not None:
        needs.append("lockstep or a gateway")
    return ", ".join(needs)


def two_columns(*headings: str) -> Table:
    """An empty table for named figures, with one column per run."""
    return Table("", *(headings or ("",)), box=None, header_style="bold", pad_edge=False)


def add_roll_over_rows(table: Table, runs: Sequence[RunVerdict]) -> None:
    """Add the figures of roll-over, one column per run."""
    rows: dict[str, Callable[[RunVerdict], str]] = {
        "true lift-off": lift_off_text,
        "first warning": lambda run: seconds_text(run.warned_s),
        "warning before lift-off": lambda run: seconds_text(run.lead_s),
        "rolls over (45°) at": lambda run: seconds_text(run.rolled_over_s),
        # true angles and loads of the plant: estimates of the ECU are in the report
        "largest roll angle": lambda run: f"{run.largest_roll * 57.2958:.1f}°",
        "smallest wheel load": lambda run: f"{100 * run.margin:.0f} % of static load",
        "largest load-transfer ratio": lambda run: f"{run.largest_load_transfer:.2f}",
    }
    # the same rows for every run, empty ones too: columns of two runs can be compared line by line
    for name, cell in rows.items():
        table.add_row(name, *(cell(run) for run in runs))


def lift_off_text(run: RunVerdict) -> str:
    if run.lift_off_s is None or run.lifting_wheel is None:
        return "none"
    return f"{run.lift_off_s:.2f} s, {WHEELS[run.lifting_wheel]}"


def seconds_text(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f} s"


def add_timing_rows(table: Table, timings: Sequence[Timing]) -> None:
    """Add the timing of the processes, one column per run."""
    # of an external node only the frames are known; its cells show a dash
    for process in ("plant", "ecu"):
        table.add_row(
            f"{process}: delay of tick start, p50 / p99",
            *(_spread(timing.lateness.get(process)) for timing in timings),
        )
        table.add_row(
            f"{process}: execution time of a tick, p50 / p99",
            *(_spread(timing.execution.get(process)) for timing in timings),
        )
    table.add_row("reaction time, p50 / p99", *(_spread(timing.reaction) for timing in timings))
    table.add_row("skipped ticks (plant, ecu)", *(_counts(timing.overruns.values()) for timing in timings))
    table.add_row("lost frames", *(str(timing.dropped) for timing in timings))
    table.add_row("processor time taken by the host", *(f"{100 * timing.stolen:.1f} %" for timing in timings))
    table.add_row(
        "waiting for a processor, worst second",
        *(_longest_wait(timing.worst_waited) for timing in timings),
    )
    table.add_row("longest wait for a processor", *(longest_wait_text(timing) for timing in timings))


def _longest_wait(shares: Mapping[str, float]) -> str:
    name = max(shares, key=lambda name: shares[name], default=None)
    return "–" if name is None else f"{100 * shares[name]:.1f} % ({name})"


def add_memory_rows(table: Table, vitals: Vitals | None) -> None:
    """Add the resident memory of each process: at its start, at its end, and the growth [MiB]."""
    for life in vitals.lives if vitals else ():
        # a process that grows in a run of seconds fails in one of days
        start, end = life.start_bytes / 2**20, life.end_bytes / 2**20
        table.add_row(
            f"{life.process}: memory, start / end", f"{start:.1f} / {end:.1f} MiB ({end - start:+.1f})"
        )


def add_hop_rows(table: Table, timings: Sequence[Timing]) -> None:
    """Add the parts of the reaction time. Runs with and without a gateway have different parts."""
    for name in dict.fromkeys(name for timing in timings for name in timing.hops):
        table.add_row(f"  {name}, p50 / p99", *(_spread(timing.hops.get(name)) for timing in timings))


def _spread(spread: Spread | None) -> str:
    if spread is None or spread.count == 0:
        return "–"
    # median and p99: the mean hides the rare late tick that a deadline is about
    return f"{spread.median * 1e-6:.2f} / {spread.p99 * 1e-6:.2f} ms"


def _counts(values: object) -> str:
    return ", ".join(str(value) for value in values)  # type: ignore[attr-defined]
