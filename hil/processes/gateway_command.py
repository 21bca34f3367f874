"""`loaderhil gateway`: options of the process that forwards frames between two buses."""

from pathlib import Path
from typing import Annotated

import typer

from hil.shell.realtime_options import CpuOption, FifoOption, FreezeOption, LockOption, RealtimeOptions

DEFAULT = {"plant": "hub:/tmp/loaderhil.plant.hub", "ecu": "hub:/tmp/loaderhil.ecu.hub"}


def gateway(
    plant_bus: Annotated[
        str,
        typer.Option(
            "--plant-bus", metavar="ADDRESS", help="Bus of the machine: hub:PATH or socketcan:INTERFACE."
        ),
    ] = DEFAULT["plant"],
    ecu_bus: Annotated[
        str,
        typer.Option("--ecu-bus", metavar="ADDRESS", help="Bus of the ECU: hub:PATH or socketcan:INTERFACE."),
    ] = DEFAULT["ecu"],
    routes: Annotated[
        Path | None,
        typer.Option(
            "--routes",
            metavar="FILE",
            help="TOML file with routing rules, in addition to the DBC's senders and receivers.",
        ),
    ] = None,
    dbc: Annotated[
        Path | None, typer.Option("--dbc", metavar="FILE", help="DBC file to use instead of the bench's own.")
    ] = None,
    protection: Annotated[
        Path | None,
        typer.Option(
            "--protection",
            metavar="FILE",
            help="Python file with counters and checksums that the DBC cannot describe.",
        ),
    ] = None,
    inject: Annotated[
        list[Path] | None,
        typer.Option(
            "--inject",
            metavar="FILE",
            help="TOML file with faults to inject, as [[fault]] tables. Repeatable.",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of the random choices of faults.")
    ] = 0,
    control: Annotated[
        Path | None,
        typer.Option(
            "--control",
            metavar="PATH",
            help="Path of the control socket for `loaderhil inject`; by default none.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for the log.")] = None,
    fifo: FifoOption = None,
    lock_memory: LockOption = False,
    cpu: CpuOption = None,
    gc_freeze: FreezeOption = True,
) -> None:
    """Forward frames between the machine's bus and the ECU's bus, until Ctrl-C.

    The times of faults count from the first frame of the machine. Example:
    `loaderhil gateway --plant-bus hub:/tmp/plant.hub --ecu-bus socketcan:can0 --control /tmp/loaderhil.control`
    """
    from hil.processes import gateway as process
    from hil.shell.process import ending_of

    between = process.Between(
        addresses={"plant": plant_bus, "ecu": ecu_bus},
        routes=routes,
        dbc=dbc,
        protection=protection,
        inject=tuple(inject or ()),
        seed=seed,
        control=control,
    )
    realtime = RealtimeOptions(fifo=fifo, lock_memory=lock_memory, cpu=cpu, gc_freeze=gc_freeze)
    raise typer.Exit(ending_of(lambda line: process.run(line, between, out, realtime)))


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(gateway)
