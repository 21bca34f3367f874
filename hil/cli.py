"""The command line: read what is wanted, call what does it, tell how it ended.

Exit codes: 0 passed, 1 failed, 2 misused, 3 a process of the bench died, 4 the bus was lost, 5 inconclusive,
130 interrupted. Modules are imported by the command that needs them, so that the hub or the
recorder does not load a plant.
"""

import importlib
import importlib.metadata
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from bus.mistake import Mistake
from hil.ending import Ending
from hil.interruption import tell_interrupted
from hil.realtime_options import CpuOption, FifoOption, FreezeOption, LockOption, RealtimeOptions

DEFAULT_BUS = "hub:/tmp/loaderhil.hub"  # a Unix socket; every user can name another
EPILOG = "Exit codes: 0 passed, 1 failed, 2 misused, 3 a process died, 4 bus lost, 5 inconclusive, 130 interrupted."

app = typer.Typer(
    name="loaderhil",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=EPILOG,
    help="Hardware-in-the-loop CAN bench for articulated wheel loaders.",
)

ScenarioArgument = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A name from `loaderhil scenarios`, or a TOML file.")
]
ScenariosArgument = Annotated[
    list[str],
    typer.Argument(metavar="SCENARIO...", help="Names from `loaderhil scenarios`, or TOML files."),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Another value for a key of the scenario's file, or, after `machine.` or `equipment.`, of theirs; repeatable.",
    ),
]
BusOption = Annotated[
    str, typer.Option("--bus", metavar="ADDRESS", help="hub:PATH, socketcan:INTERFACE or virtual:NAME.")
]
PayloadOption = Annotated[
    float | None,
    typer.Option("--payload-kg", min=0, max=20_000, help="Payload in the bucket instead of the scenario's."),
]
SeedOption = Annotated[
    int | None,
    typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of the sensor noise instead of the scenario's."),
]
FormOption = Annotated[
    str,
    typer.Option(
        "--form", metavar="FORM", help="Estimator equations: corrected, or printed as in the thesis."
    ),
]
LimitsOption = Annotated[
    bool, typer.Option("--limits/--no-limits", help="Whether the ECU limits the machine, or only warns.")
]


def _version(wanted: bool) -> None:
    if wanted:
        print(f"loaderhil {importlib.metadata.version('loaderhil')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and end.")
    ] = False,
) -> None:
    """Hardware-in-the-loop CAN bench for articulated wheel loaders."""


@app.command()
def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Where the runs and report.html go.")
    ] = Path("out/demo"),
    fast: Annotated[
        bool, typer.Option("--fast", help="In lockstep instead of real time: seconds, no timing.")
    ] = False,
) -> None:
    """Roll-over with the ECU's limits off, then on: was it announced, was it prevented.

    Plant and ECU run as processes over a CAN hub in real time. Example: `loaderhil demo --out out/demo`
    """
    from hil.demo import run_demo

    raise typer.Exit(run_demo(out, fast=fast))


@app.command()
def run(
    scenarios: ScenariosArgument,
    realtime: Annotated[
        bool, typer.Option("--realtime/--lockstep", help="As processes in real time, or on a virtual clock.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Run directory, by default out/SCENARIO; the folder of all of them if there are several.",
        ),
    ] = None,
    limits: LimitsOption = True,
    form: FormOption = "corrected",
    payload_kg: PayloadOption = None,
    seed: SeedOption = None,
    changes: SetOption = None,
    machine: Annotated[
        str | None,
        typer.Option(
            "--machine",
            metavar="NAME|FILE",
            help="Instead of the scenario's; equipment and calibration beside its file, as `diagnose --apply` writes them, are used too.",
        ),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Timing that could not be judged counts as failed.")
    ] = False,
    inject: Annotated[
        Path | None, typer.Option("--inject", metavar="FILE", help="TOML file with [[fault]] tables.")
    ] = None,
    gateway: Annotated[
        bool, typer.Option("--gateway", help="In real time, with plant and ECU on buses of their own.")
    ] = False,
    plant_bus: Annotated[
        str | None, typer.Option("--plant-bus", metavar="ADDRESS", help="With --gateway; by default a hub.")
    ] = None,
    ecu_bus: Annotated[
        str | None, typer.Option("--ecu-bus", metavar="ADDRESS", help="With --gateway; by default a hub.")
    ] = None,
    routes: Annotated[
        Path | None, typer.Option("--routes", metavar="FILE", help="With --gateway: its TOML file.")
    ] = None,
    control: Annotated[
        Path | None, typer.Option("--control", metavar="PATH", help="With --gateway: socket for `inject`.")
    ] = None,
    fifo: FifoOption = None,
    lock_memory: LockOption = False,
    cpu: CpuOption = None,
    gc_freeze: FreezeOption = True,
) -> None:
    """Run one scenario, or several, and say what happened.

    Examples: `loaderhil run loaded unloaded hard_braking` or `loaderhil run abrupt_articulation --no-limits --realtime` or
    `loaderhil run loaded --set surface.friction=0.4 --set machine.steering.time_constant_s=0.05` or
    `loaderhil run loaded --gateway --ecu-bus socketcan:can0` or `loaderhil run loaded --realtime --fifo 50 --lock-memory`
    """
    from hil.compose import Choice
    from hil.console import tell_run
    from hil.gateway.buses import Buses

    choices = [
        Choice(
            scenario=scenario,
            form=_form(form),
            limits=limits,
            payload_kg=payload_kg,
            seed=seed,
            inject=inject,
            changes=tuple(changes or ()),
        )
        for scenario in scenarios
    ]
    if machine is not None:
        choices = [choice.on(machine) for choice in choices]
    buses = Buses(gateway=gateway, plant=plant_bus, ecu=ecu_bus, routes=routes, control=control)
    options = RealtimeOptions(fifo=fifo, lock_memory=lock_memory, cpu=cpu, gc_freeze=gc_freeze)
    if not realtime and not gateway and options.words():
        raise typer.BadParameter(
            "is about processes in real time; add --realtime or --gateway", param_hint=options.words()[0]
        )
    timed = options if realtime or gateway else None
    if len(choices) > 1:
        from hil.several import tell_runs

        raise typer.Exit(tell_runs(choices, out or Path("out"), realtime=timed, strict=strict, buses=buses))
    folder = out or Path("out") / Path(scenarios[0]).stem
    raise typer.Exit(tell_run(choices[0], folder, realtime=timed, strict=strict, buses=buses))


@app.command()
def plant(
    scenario: ScenarioArgument,
    bus: BusOption = DEFAULT_BUS,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Leave truth and timing here.")
    ] = None,
    payload_kg: PayloadOption = None,
    seed: SeedOption = None,
    changes: SetOption = None,
    fifo: FifoOption = None,
    lock_memory: LockOption = False,
    cpu: CpuOption = None,
    gc_freeze: FreezeOption = True,
) -> None:
    """The machine alone, as a process on a bus, until its scenario is over.

    Example: `loaderhil plant loaded --bus socketcan:can0` against a real ECU.
    """
    from hil.processes.lean import without_mf4

    without_mf4()

    from hil.compose import Choice
    from hil.processes import plant as process
    from hil.processes.shell import ending_of

    choice = Choice(scenario=scenario, payload_kg=payload_kg, seed=seed, changes=tuple(changes or ()))
    realtime = RealtimeOptions(fifo=fifo, lock_memory=lock_memory, cpu=cpu, gc_freeze=gc_freeze)
    raise typer.Exit(ending_of(lambda line: process.run(line, choice, bus, out, realtime)))


@app.command()
def ecu(
    bus: BusOption = DEFAULT_BUS,
    form: FormOption = "corrected",
    limits: LimitsOption = True,
    calibration: Annotated[
        str, typer.Option("--calibration", metavar="NAME|FILE", help="What the ECU knows of its machine.")
    ] = "l60",
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Leave timing here.")] = None,
    fifo: FifoOption = None,
    lock_memory: LockOption = False,
    cpu: CpuOption = None,
    gc_freeze: FreezeOption = True,
) -> None:
    """The virtual ECU alone, as a process on a bus, until Ctrl-C.

    Example: `loaderhil ecu --bus socketcan:can0 --fifo 50 --lock-memory --cpu 1`
    """
    from hil.processes.lean import without_mf4

    without_mf4()

    from hil.processes import ecu as process
    from hil.processes.shell import ending_of

    checked = _form(form)
    realtime = RealtimeOptions(fifo=fifo, lock_memory=lock_memory, cpu=cpu, gc_freeze=gc_freeze)
    raise typer.Exit(
        ending_of(lambda line: process.run(line, checked, limits, bus, out, realtime, calibration))
    )


@app.command()
def hub(
    bus: BusOption = DEFAULT_BUS,
    bit_rate: Annotated[
        int | None,
        typer.Option(
            "--bit-rate", min=5_000, max=20_000_000, help="Also take the time of a real bus [bit/s]."
        ),
    ] = None,
    data_bit_rate: Annotated[
        int | None,
        typer.Option(
            "--data-bit-rate", min=5_000, max=20_000_000, help="Of CAN FD frames that switch it [bit/s]."
        ),
    ] = None,
    status: Annotated[
        bool, typer.Option("--status", help="Show who is on a running hub and who loses frames, and end.")
    ] = False,
    fifo: FifoOption = None,
    lock_memory: LockOption = False,
    cpu: CpuOption = None,
    gc_freeze: FreezeOption = True,
) -> None:
    """The CAN bus of machines without CAN, as a process, until Ctrl-C.

    Examples: `loaderhil hub --bit-rate 500000 --data-bit-rate 2000000`, and beside it `loaderhil hub --status`
    """
    from hil.processes import hub as process
    from hil.processes.shell import ending_of

    if status:
        raise typer.Exit(ending_of(lambda line: process.tell_status(bus)))
    realtime = RealtimeOptions(fifo=fifo, lock_memory=lock_memory, cpu=cpu, gc_freeze=gc_freeze)
    rates = process.BitRates(bit_rate, data_bit_rate)
    raise typer.Exit(ending_of(lambda line: process.run(line, bus, rates, realtime)))


@app.command()
def scenarios(
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="[FILE]...", help="TOML files to look at instead.")
    ] = None,
) -> None:
    """List the drive cases that come with loaderhil, or check files of your own without running them.

    Example: `loaderhil scenarios wet_bend.toml`
    """
    from hil.console import tell_scenarios

    tell_scenarios(files or [])


@app.command()
def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run directories.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The page to write.")] = Path(
        "out/report.html"
    ),
) -> None:
    """One self-contained HTML page about one or more runs.

    Example: `loaderhil report out/loaded out/unloaded --out both.html`
    """
    from hil.report import write_report

    print(write_report(runs, out))


campaign = typer.Typer(no_args_is_help=True, help="Tables over many runs; each by one command, reproducible.")
app.add_typer(campaign, name="campaign")

JobsOption = Annotated[
    int | None, typer.Option("--jobs", min=1, help="Processes; by default one per processor.")
]
ResultsOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the table goes.")]


@campaign.command("normal-force")
def campaign_normal_force(out: ResultsOption = Path("docs/results"), jobs: JobsOption = None) -> None:
    """Normal force estimates against plant truth in every drive case, both forms."""
    from hil.campaign.normal_force import run_campaign

    print(run_campaign(out, jobs))


@campaign.command("roll-over")
def campaign_roll_over(
    out: ResultsOption = Path("docs/results"),
    jobs: JobsOption = None,
    extended: Annotated[
        bool, typer.Option("--extended", help="On grades, banks and slippery ground instead of the level.")
    ] = False,
) -> None:
    """Warning, lead and prevention over a grid of speed, load and articulation rate."""
    from hil.campaign import roll_over, roll_over_extended

    print((roll_over_extended if extended else roll_over).run_campaign(out, jobs))


def _form(form: str) -> Any:
    forms = ("corrected", "printed")
    if form not in forms:
        raise typer.BadParameter(f"'{form}' is not one of {', '.join(forms)}", param_hint="--form")
    return form


# Commands whose options live with their code: the module's `register(app)` adds them.
ELSEWHERE = {
    "decode": "hil.decode",
    "monitor": "hil.monitor.command",
    "record": "hil.recording.command",
    "replay": "hil.recording.replay_command",
    "check": "hil.recording.check_command",
    "gateway": "hil.gateway.command",
    "inject": "hil.faults.command",
    "soak": "hil.faults.soak_command",
    "mqtt": "hil.mqtt.command",
    "effects": "hil.effects",
    "diagnose": "hil.diagnose.command",
    "conceal": "hil.diagnose.conceal",
    "score": "hil.diagnose.score",
    "thesis": "hil.thesis.command",
    "standards": "hil.standards.command",
    "render": "hil.render.command",
}


# What the help shows together; the order is that of a user's way through the bench.
PANELS = {
    "The bench": ("demo", "run", "plant", "ecu", "hub", "gateway", "inject", "soak"),
    "Buses and recordings": ("monitor", "record", "replay", "check", "decode", "mqtt"),
    "What physics was left out": ("diagnose", "conceal", "score", "effects"),
    "The machine and its results": ("scenarios", "report", "render", "campaign", "standards", "thesis"),
}


def _arrange() -> None:
    """Commands in the order and under the titles of PANELS."""
    panel_of = {name: panel for panel, names in PANELS.items() for name in names}
    order = list(panel_of)
    for command in app.registered_commands:
        command.name = command.name or getattr(command.callback, "__name__", None)
        command.rich_help_panel = panel_of[command.name or ""]
    for group in app.registered_groups:
        group.rich_help_panel = panel_of[group.name or ""]
    app.registered_commands.sort(key=lambda command: order.index(command.name or ""))


def _register_elsewhere() -> None:
    """Add the commands of ELSEWHERE: all of them for the help, else only the one that is asked for."""
    here = {command.callback.__name__ for command in app.registered_commands if command.callback}
    here |= {group.name for group in app.registered_groups if group.name}
    asked = sys.argv[1] if len(sys.argv) > 1 else ""
    if asked in here:
        return
    for module in [ELSEWHERE[asked]] if asked in ELSEWHERE else ELSEWHERE.values():
        importlib.import_module(module).register(app)


def main() -> None:
    """Entry point: everything a user can get wrong ends in one line, not in a traceback."""
    try:
        _register_elsewhere()
        _arrange()
        app()
    except KeyboardInterrupt:
        tell_interrupted()
        sys.exit(Ending.INTERRUPTED)
    except SystemExit as ended:
        if ended.__context__ is not None and isinstance(ended.__context__.__cause__, KeyboardInterrupt):
            tell_interrupted()  # Typer ends an interrupted command without a word
        raise
    except Mistake as error:
        print(f"loaderhil: {error}", file=sys.stderr)
        sys.exit(Ending.MISUSED)
    except OSError as error:
        if error.filename is None:  # not about a file the user named
            raise
        print(f"loaderhil: {error.filename}: {error.strerror}", file=sys.stderr)
        sys.exit(Ending.FAILED)
