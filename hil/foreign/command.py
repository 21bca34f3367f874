"""`loaderhil attend`: started by `loaderhil run --ecu BUS` and `--plant BUS`; by hand it shows whether a node is present."""

from typing import Annotated

import typer

from hil.faults.passage import NODES


def attend(
    bus: Annotated[str, typer.Argument(metavar="BUS", help="Bus: hub:PATH or socketcan:INTERFACE.")],
    node: Annotated[
        str, typer.Option("--node", metavar="NODE", help="Node of the DBC: EstimatorEcu or Machine.")
    ] = "EstimatorEcu",
    wait_s: Annotated[
        float, typer.Option("--wait-s", min=0.0, help="How long to wait for the node's first frame [s].")
    ] = 60.0,
    for_s: Annotated[
        float | None, typer.Option("--for-s", min=0.1, help="End so long after the node came [s].")
    ] = None,
) -> None:
    """Wait for a node on a bus, and report when it falls silent and when it is back.

    Exit code 3: the node did not come. Example: `loaderhil attend socketcan:can0 --node EstimatorEcu --for-s 10`
    """
    from hil.foreign import attend as process
    from hil.shell.process import ending_of

    if node not in NODES:
        raise typer.BadParameter(f"{node!r} is not one of {', '.join(NODES)}", param_hint="--node")
    post = process.Post(node=node, address=bus, wait_s=wait_s, duration_s=for_s)
    raise typer.Exit(ending_of(lambda line: process.run(line, post)))


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(attend)
