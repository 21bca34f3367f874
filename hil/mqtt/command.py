"""`loaderhil mqtt`: its options."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from bus.mistake import Mistake

DEFAULT_BUS = "hub:/tmp/loaderhil.hub"


class PrefixError(Mistake, ValueError):
    """A prefix that MQTT does not allow in a topic that is published."""


def mqtt(
    bus: Annotated[
        list[str] | None,
        typer.Option("--bus", metavar="ADDRESS", help=f"Bus, may be repeated; default {DEFAULT_BUS}."),
    ] = None,
    broker: Annotated[
        str, typer.Option("--broker", metavar="HOST:PORT", help="The MQTT broker.")
    ] = "localhost:1883",
    prefix: Annotated[
        str, typer.Option("--prefix", metavar="TOPIC", help="What every topic begins with.")
    ] = "loaderhil",
    every_ms: Annotated[
        int, typer.Option("--every-ms", min=10, max=60_000, help="How often a message is published at most.")
    ] = 100,
    dbc: Annotated[
        list[Path] | None,
        typer.Option("--dbc", metavar="FILE", help="DBC file, may be repeated; default as for monitor."),
    ] = None,
    message: Annotated[
        list[str] | None, typer.Option("--message", "-m", metavar="NAME", help="Only these messages.")
    ] = None,
    sender: Annotated[
        list[str] | None, typer.Option("--sender", metavar="NODE", help="Only messages of that sender.")
    ] = None,
    signals: Annotated[
        list[str] | None, typer.Option("--signals", "-s", metavar="A,B", help="Only these signals.")
    ] = None,
    control: Annotated[
        Path | None,
        typer.Option(
            "--control",
            metavar="PATH",
            help="Pass commands on to this control socket of a gateway; without: none.",
        ),
    ] = None,
) -> None:
    """Decoded signals and findings to an MQTT broker, and fault injection from there, until Ctrl-C.

    Example: `loaderhil mqtt --bus socketcan:can0 --broker localhost:1883`, then
    `mosquitto_sub -v -t 'loaderhil/#'`
    """
    from hil.ending import Ending
    from hil.lifeline import Lifeline
    from hil.monitor.board import Board
    from hil.monitor.choice import known_messages, names, watched
    from hil.monitor.source import Buses
    from hil.mqtt.bridge import Bridge, Broker
    from hil.mqtt.publications import Topics
    from hil.processes.shell import ending_of, run_until_signal

    if not prefix or set(prefix) & {"+", "#", "\0"} or prefix.startswith("$") or prefix.endswith("/"):
        raise PrefixError(f"prefix '{prefix}': a topic without +, #, a $ in front or a / at its end")
    where = Broker.parse(broker)
    messages = known_messages(dbc or [], names(message), names(sender), names(signals), protection=False)

    def body(line: Lifeline) -> Ending:
        with Buses(watched(bus or [DEFAULT_BUS], with_errors=True), client="mqtt") as buses:
            line.ready()
            bridge = Bridge(
                buses, Board(messages), where, Topics(prefix), every_s=every_ms * 1e-3, control=control
            )
            run_until_signal(bridge.run())
            print(f"loaderhil: interrupted after {bridge.frames} frames", file=sys.stderr)
        return Ending.INTERRUPTED

    raise typer.Exit(ending_of(body))


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(mqtt)
