"""`loaderhil restbus`: simulated nodes of a DBC on a bus."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from loaderhil.testing.databases import LOADER, DbcOption, ProtectionOption


def restbus(
    bus: Annotated[str, typer.Argument(metavar="BUS", help="Bus: hub:PATH or socketcan:INTERFACE.")],
    node: Annotated[list[str], typer.Option("--node", metavar="NODE", help="Node to simulate. Repeatable.")],
    dbc: DbcOption = LOADER,
    values: Annotated[
        Path | None,
        typer.Option(
            "--values",
            metavar="FILE",
            help="TOML file with values, generators and a script; by default NAME.values.toml beside NAME.dbc.",
        ),
    ] = None,
    protection: ProtectionOption = None,
    for_s: Annotated[
        float | None, typer.Option("--for-s", min=0.01, help="End after this time [s]; without it at Ctrl-C.")
    ] = None,
) -> None:
    """Simulate nodes of a DBC on a bus: every cyclic and event message, with right counters and checksums.

    Lines on standard input change values while it runs: `Message.Signal = VALUE`, `stop Message`, `resume Message`,
    `send Message`. Example: `loaderhil restbus hub:/tmp/bench.hub --node Machine`
    """
    from hil.shell.process import ending_of
    from loaderhil.testing.databases import database_of
    from testbench.restbus.core import RestBus
    from testbench.restbus.running import Orders, run
    from testbench.restbus.values import values_for

    database, chosen = database_of(dbc, protection), values_for(dbc, values)
    RestBus(database, node, chosen.generators)  # a mistake is reported before the bus is opened
    # a service has no standard input, or a closed one: the bus then runs by its script alone
    typed = None if sys.stdin is None or sys.stdin.closed else sys.stdin.fileno()
    raise typer.Exit(
        ending_of(
            lambda line: run(
                line,
                bus,
                lambda start_ns: RestBus(database, node, chosen.generators, start_ns=start_ns),
                chosen,
                for_s=for_s,
                orders=Orders(typed),
            )
        )
    )


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(restbus)
