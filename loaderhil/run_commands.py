"""`loaderhil run` and `loaderhil demo`: their options. `loaderhil.single`, `several` and `comparison` do the work."""

from pathlib import Path
from typing import Annotated

import typer

from hil.shell.collector import uncollected
from hil.shell.realtime_options import CpuOption, FifoOption, FreezeOption, LockOption, RealtimeOptions
from loaderhil.options import (
    DetectOption,
    EcuCoreOption,
    ForeignEcuOption,
    ForeignPlantOption,
    FormOption,
    JsonOption,
    JunitOption,
    LimitsOption,
    PayloadOption,
    SeedOption,
    SetOption,
    WaitOption,
    checked_core,
    checked_form,
)


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(demo)
    app.command()(run)


def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the two run directories and report.html.")
    ] = Path("out/demo"),
    fast: Annotated[
        bool,
        typer.Option(
            "--fast", help="Run on a virtual clock instead of real time. Takes seconds; shows no timing."
        ),
    ] = False,
) -> None:
    """Run one roll-over twice, without and with the ECU's limits, and compare.

    Was the roll-over announced in time, and did the limits prevent it? The simulated machine and the ECU run as processes
    on a CAN hub, in real time. Example: `loaderhil demo --out out/demo`
    """
    from loaderhil.comparison import run_demo

    raise typer.Exit(run_demo(out, fast=fast))


def run(
    scenarios: Annotated[
        list[str],
        typer.Argument(metavar="SCENARIO...", help="Names from `loaderhil scenarios`, or TOML files."),
    ],
    realtime: Annotated[
        bool,
        typer.Option(
            "--realtime/--lockstep",
            help="Run plant and ECU as processes in real time, or in one process on a virtual clock.",
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Run directory; by default out/SCENARIO. With several scenarios: the folder that holds their run directories.",
        ),
    ] = None,
    limits: LimitsOption = True,
    detect_faults: DetectOption = True,
    form: FormOption = "corrected",
    ecu_core: EcuCoreOption = "auto",
    payload_kg: PayloadOption = None,
    seed: SeedOption = None,
    changes: SetOption = None,
    machine: Annotated[
        str | None,
        typer.Option(
            "--machine",
            metavar="NAME|FILE",
            help="Machine to use instead of the scenario's. Equipment and calibration files beside the machine file, as `diagnose --apply` writes them, are used too.",
        ),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Count an inconclusive verdict as failed.")
    ] = False,
    expect: Annotated[
        Path | None,
        typer.Option("--expect", metavar="FILE", help="TOML file with pass criteria, as [[expect]] tables."),
    ] = None,
    json_output: JsonOption = False,
    junit: JunitOption = None,
    inject: Annotated[
        Path | None,
        typer.Option(
            "--inject", metavar="FILE", help="TOML file with faults to inject, as [[fault]] tables."
        ),
    ] = None,
    gateway: Annotated[
        bool,
        typer.Option(
            "--gateway", help="Run in real time, with plant and ECU on two buses and a gateway between them."
        ),
    ] = False,
    plant_bus: Annotated[
        str | None,
        typer.Option(
            "--plant-bus", metavar="ADDRESS", help="With --gateway: the plant's bus; by default a hub."
        ),
    ] = None,
    ecu_bus: Annotated[
        str | None,
        typer.Option("--ecu-bus", metavar="ADDRESS", help="With --gateway: the ECU's bus; by default a hub."),
    ] = None,
    foreign_ecu: ForeignEcuOption = None,
    foreign_plant: ForeignPlantOption = None,
    # a real ECU boots within seconds; a minute leaves time to switch it on by hand
    wait_s: WaitOption = 60.0,
    routes: Annotated[
        Path | None,
        typer.Option("--routes", metavar="FILE", help="With --gateway: TOML file with rules for its routes."),
    ] = None,
    control: Annotated[
        Path | None,
        typer.Option(
            "--control",
            metavar="PATH",
            help="With --gateway: path of its control socket, for `loaderhil inject`.",
        ),
    ] = None,
    fifo: FifoOption = None,
    lock_memory: LockOption = False,
    cpu: CpuOption = None,
    gc_freeze: FreezeOption = True,
) -> None:
    """Run one or several scenarios and show the results.

    Examples: `loaderhil run loaded unloaded hard_braking` or `loaderhil run abrupt_articulation --no-limits --realtime` or
    `loaderhil run loaded --set surface.friction=0.4 --set machine.steering.time_constant_s=0.05` or
    `loaderhil run loaded unloaded --expect criteria.toml --junit results.xml` or
    `loaderhil run loaded --gateway --ecu socketcan:can0` (a real ECU on can0) or `loaderhil run loaded --realtime --fifo 50 --lock-memory`
    """
    # some hundred thousand objects are loaded that stay: searching them again and again takes a fifth of a run's start
    with uncollected(kept=True):
        from hil.compose import Choice
        from hil.gateway.buses import Buses
        from loaderhil.single import Output, report_run

    fmu = Path(foreign_plant) if foreign_plant is not None and foreign_plant.endswith(".fmu") else None
    # checked as a whole there: which addresses go together depends on --gateway and on what is external
    buses = Buses(
        gateway=gateway,
        plant=plant_bus,
        ecu=ecu_bus,
        routes=routes,
        control=control,
        foreign_ecu=foreign_ecu,
        foreign_plant=foreign_plant if fmu is None else None,
        wait_s=wait_s,
    )
    # lockstep has neither a gateway nor a bus on which an external node could be
    realtime = realtime or gateway or bool(buses.foreign)
    core = checked_core(ecu_core, both=True, lockstep=not realtime)
    choices = [
        Choice(
            scenario=scenario,
            form=checked_form(form),
            core=core,
            limits=limits,
            detect_faults=detect_faults,
            payload_kg=payload_kg,
            seed=seed,
            inject=inject,
            expect=expect,
            changes=tuple(changes or ()),
            fmu=fmu,
        )
        for scenario in scenarios
    ]
    if machine is not None:
        # equipment and calibration that belong to the machine are taken with it
        choices = [choice.on(machine) for choice in choices]
    options = RealtimeOptions(fifo=fifo, lock_memory=lock_memory, cpu=cpu, gc_freeze=gc_freeze)
    if realtime and core.name == "both":
        raise typer.BadParameter(
            "both cores are compared in lockstep only; leave --realtime, --gateway, --ecu and --plant out",
            param_hint="--ecu-core",
        )
    # refused and not ignored: who asks for a priority believes that the run had it
    if not realtime and options.words():
        raise typer.BadParameter(
            "applies to processes in real time only; add --realtime or --gateway",
            param_hint=options.words()[0],
        )
    output = Output(json=json_output, junit=junit)
    # None means lockstep from here on down
    timed = options if realtime else None
    # one run gets its figures in full, several share one table with a row each
    if len(choices) > 1:
        from loaderhil.several import report_runs

        raise typer.Exit(
            report_runs(
                choices, out or Path("out"), realtime=timed, strict=strict, buses=buses, output=output
            )
        )
    # a scenario may be a path; its folder has the name alone
    folder = out or Path("out") / Path(scenarios[0]).stem
    raise typer.Exit(
        report_run(choices[0], folder, realtime=timed, strict=strict, buses=buses, output=output)
    )
