"""`loaderhil conform`: conformance of a controller against its DBC, on a live bus or from a recording."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from dbc.database import Database
from hil.ending import Ending
from loaderhil.testing.databases import LOADER, DbcOption, ProtectionOption
from testbench.conform.evidence import Evidence
from testbench.conform.requirements import Requirement
from testbench.restbus.generators import Generator

# Addresses of buses; everything else is a path. A file of such a name can be given as ./hub:x.
SCHEMES = ("hub:", "socketcan:", "virtual:")


def conform(
    source: Annotated[
        str,
        typer.Argument(
            metavar="BUS|RECORDING",
            help="Bus (hub:PATH or socketcan:INTERFACE) for a live test, or a recording or run directory.",
        ),
    ],
    node: Annotated[
        str, typer.Option("--node", metavar="NODE", help="Node of the DBC that is tested.")
    ] = "EstimatorEcu",
    dbc: DbcOption = LOADER,
    values: Annotated[
        Path | None,
        typer.Option(
            "--values",
            metavar="FILE",
            help="Values of the simulated inputs; by default NAME.values.toml beside NAME.dbc.",
        ),
    ] = None,
    protection: ProtectionOption = None,
    lose: Annotated[
        list[str] | None,
        typer.Option("--lose", metavar="MESSAGE", help="Lose only this input in turn. Repeatable."),
    ] = None,
    steady_s: Annotated[
        float, typer.Option("--steady-s", min=0.5, help="Length of the traffic without losses [s].")
    ] = 3.0,
    wait_s: Annotated[
        float, typer.Option("--wait-s", min=0.0, help="How long to wait for the node's first frame [s].")
    ] = 60.0,
    from_start: Annotated[
        bool,
        typer.Option("--from-start", help="The recording begins before the node was switched on."),
    ] = False,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where page and record go.")] = Path(
        "out/conform"
    ),
    json_output: Annotated[bool, typer.Option("--json", help="Print the verdicts as JSON.")] = False,
    junit: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="The verdicts also as JUnit XML.")
    ] = None,
) -> None:
    """Test a controller against its DBC: presence, cycle times, contents, start-up, states after loss of inputs.

    On a bus all other nodes are simulated, and each input is withheld in turn. Exit code 0: every requirement is kept; 1: one is
    broken; 3: the node did not come; 5: one could not be judged. Examples: `loaderhil conform socketcan:can0`,
    `loaderhil conform drive.blf --dbc car.dbc --node Engine`
    """
    from hil.results import as_json, ending_of, write_junit
    from loaderhil.testing.databases import database_of
    from report.testing.conformance import page
    from report.testing.writing import write_page
    from testbench.conform.results import suite_of
    from testbench.conform.session import judge

    database = database_of(dbc, protection)
    if source.startswith(SCHEMES):
        from testbench.restbus.values import values_for

        # a recording needs no values: nothing is sent
        generators = values_for(dbc, values).generators
        evidence = _live(source, database, node, generators, lose or [], steady_s, wait_s, out)
    else:
        evidence = _recorded(Path(source), database, node, from_start)
    found = judge(evidence)
    ending = ending_of(each.result for each in found)
    suite = suite_of(f"{node} on {source}", found, evidence.since(evidence.observer.end_ns))
    if junit is not None:
        write_junit(junit, "conform", [suite])
    file = write_page(page(node, source, str(dbc), found), out / "conform.html")
    if json_output:
        print(as_json("conform", ending, [suite]))
    else:
        _print(Console(highlight=False, soft_wrap=True), found, file)
    raise typer.Exit(ending)


def _live(
    bus: str,
    database: Database,
    node: str,
    generators: Mapping[str, Generator],
    lose: Sequence[str],
    steady_s: float,
    wait_s: float,
    out: Path,
) -> Evidence:
    """The evidence of a live test; its record is kept in `out`."""
    from bus.transport import BusClosed
    from testbench.conform.evidence import ConformError
    from testbench.conform.live import keep, watch
    from testbench.conform.session import Session

    # before the bus is opened: a test of seconds would end with nothing lost
    if unknown := [name for name in lose if name not in database.by_name]:
        raise ConformError(f"--lose {unknown[0]}: {database.source} has no such message")

    def notify(text: str) -> None:
        # standard error: standard output may be JSON
        print(f"loaderhil: {text}", file=sys.stderr)

    try:
        session, watched = watch(
            bus,
            lambda start_ns: Session(
                database, node, generators, start_ns=start_ns, steady_s=steady_s, only=tuple(lose)
            ),
            wait_s=wait_s,
            notify=notify,
        )
    except BusClosed as error:
        notify(f"lost the bus: {error}")
        raise typer.Exit(Ending.HUB_LOST) from None
    if watched.ended != "came":
        if watched.ended == "absent":
            notify(
                f"{node} sent none of its messages on {bus} within {wait_s:g} s: is it powered, and on this bus?"
            )
        raise typer.Exit(Ending.PEER_DIED if watched.ended == "absent" else Ending.INTERRUPTED)
    # kept before it is judged: a defect of the judgement must not cost the record
    keep(session, watched.bench, out)
    return session.evidence(watched.bench)


def _recorded(recording: Path, database: Database, node: str, from_start: bool) -> Evidence:
    """The evidence of a recording; of a run directory: what the node itself could hear."""
    from dbc.recordings.reading import read_frames
    from hil import rundir
    from hil.rundir import ECU_BUS, read_record
    from testbench.conform.evidence import Bench
    from testbench.conform.live import kept_bench

    bench = Bench()
    if recording.is_dir() and not (recording / rundir.RECORD).exists() and (recording / rundir.BUS).exists():
        bench = kept_bench(recording)
        recording = recording / rundir.BUS  # what an earlier live test left
    if recording.is_dir():
        record = read_record(recording)
        dropped = int(record.statistics.get("recorder_dropped", 0))
        # The processes of a run share one computer; in lockstep its time does not count.
        bench = Bench(dropped=dropped, shared_host=record.mode == "realtime")
        behind = recording / ECU_BUS  # with a gateway the ECU has a bus of its own
        recording = behind if node == "EstimatorEcu" and behind.exists() else recording / rundir.BUS
    bench = replace(bench, from_start=bench.from_start or from_start)
    return Evidence.of(read_frames(recording), database, node, bench)


def _print(console: Console, found: Sequence[Requirement], file: Path) -> None:
    """What is not passed, one line each; then the sum and the page."""
    from hil.check.tables import COLOUR
    from hil.verdict import Result
    from testbench.conform.results import summary

    for each in found:
        if each.result is not Result.PASSED:
            colour = COLOUR[each.result]
            console.print(
                f"[{colour}]{each.result.value:<12}[/] {escape(each.subject)}: {each.kind.value}: {escape(each.evidence)}"
            )
    console.print(summary(found))
    console.print(f"page: {file}")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(conform)
