"""`loaderhil mqtt`: the options of the command that starts the MQTT bridge."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from bus.user_error import UserError

LOGIN = "Login"
DEFAULT_BUS = "hub:/tmp/loaderhil.hub"


class PrefixError(UserError, ValueError):
    """A prefix that MQTT does not allow in a topic that is published."""


class CommandsError(UserError, ValueError):
    """Commands are to be accepted, but no key is given by which senders are recognised."""


def mqtt(
    bus: Annotated[
        list[str] | None,
        typer.Option(
            "--bus", metavar="ADDRESS", help=f"Address of a bus; by default {DEFAULT_BUS}. Repeatable."
        ),
    ] = None,
    broker: Annotated[
        str, typer.Option("--broker", metavar="HOST:PORT", help="Address of the MQTT broker.")
    ] = "localhost:1883",
    prefix: Annotated[
        str, typer.Option("--prefix", metavar="TOPIC", help="First part of every topic.")
    ] = "loaderhil",
    every_ms: Annotated[
        int,
        typer.Option(
            "--every-ms",
            min=10,
            max=60_000,
            help="Shortest time between two publications of one message [ms].",
        ),
    ] = 100,
    dbc: Annotated[
        list[Path] | None,
        typer.Option("--dbc", metavar="FILE", help="DBC file; by default those of `monitor`. Repeatable."),
    ] = None,
    message: Annotated[
        list[str] | None,
        typer.Option(
            "--message",
            "-m",
            metavar="NAME",
            help="Publish only messages of this name. Repeatable; shell patterns.",
        ),
    ] = None,
    sender: Annotated[
        list[str] | None,
        typer.Option(
            "--sender",
            metavar="NODE",
            help="Publish only messages that this node sends. Repeatable; shell patterns.",
        ),
    ] = None,
    signals: Annotated[
        list[str] | None,
        typer.Option(
            "--signals",
            "-s",
            metavar="A,B",
            help="Publish only these signals, as Signal or Message.Signal; shell patterns.",
        ),
    ] = None,
    control: Annotated[
        Path | None,
        typer.Option(
            "--control",
            metavar="PATH",
            help="Control socket of a gateway. Commands from the broker are passed on to it; by default none are taken.",
        ),
    ] = None,
    command_key: Annotated[
        Path | None,
        typer.Option(
            "--command-key",
            metavar="FILE",
            help="With --control: file with the key that every command must carry, at least 16 characters.",
        ),
    ] = None,
    user: Annotated[
        str | None,
        typer.Option("--user", metavar="NAME", help="User name for the broker.", rich_help_panel=LOGIN),
    ] = None,
    password_file: Annotated[
        Path | None,
        typer.Option(
            "--password-file",
            metavar="FILE",
            help="File with the password for the broker in its first line.",
            rich_help_panel=LOGIN,
        ),
    ] = None,
    tls: Annotated[
        bool,
        typer.Option(
            "--tls",
            help="Encrypt the connection (TLS); the default port is then 8883.",
            rich_help_panel=LOGIN,
        ),
    ] = False,
    tls_authority: Annotated[
        Path | None,
        typer.Option(
            "--tls-authority",
            metavar="FILE",
            help="Certificates to trust (PEM); by default those of the system. Implies --tls.",
            rich_help_panel=LOGIN,
        ),
    ] = None,
    tls_certificate: Annotated[
        Path | None,
        typer.Option(
            "--tls-certificate",
            metavar="FILE",
            help="Certificate of this client (PEM). Implies --tls.",
            rich_help_panel=LOGIN,
        ),
    ] = None,
    tls_key: Annotated[
        Path | None,
        typer.Option(
            "--tls-key", metavar="FILE", help="Private key of that certificate (PEM).", rich_help_panel=LOGIN
        ),
    ] = None,
) -> None:
    """Publish decoded signals and findings to an MQTT broker, until Ctrl-C.

    Example: `loaderhil mqtt --bus socketcan:can0 --broker localhost:1883`, then
    `mosquitto_sub -v -t 'loaderhil/#'`
    """
    from hil.ending import Ending
    from hil.monitor.board import Board
    from hil.monitor.choice import known_messages, names, watched
    from hil.monitor.source import Buses
    from hil.mqtt.bridge import Bridge
    from hil.mqtt.broker import Broker, read_secret, tls_context
    from hil.mqtt.commands import Commands
    from hil.mqtt.publications import Topics
    from hil.shell.lifeline import Lifeline
    from hil.shell.process import ending_of, run_until_signal

    # wildcards are not allowed in a topic that is published; $ topics belong to the broker (MQTT 3.1.1, 4.7)
    if not prefix or set(prefix) & {"+", "#", "\0"} or prefix.startswith("$") or prefix.endswith("/"):
        raise PrefixError(
            f"--prefix '{prefix}': a topic must not be empty, contain + or #, start with $ or end with /"
        )
    # a control socket without a key would let every client of the broker inject faults
    if (control is None) != (command_key is None):
        raise CommandsError("--control and --command-key belong together: who has the key may give commands")
    commands = None
    if control is not None and command_key is not None:
        commands = Commands(control, read_secret("--command-key", command_key))
    certificates = (tls_authority, tls_certificate, tls_key)
    # a certificate on an unencrypted connection would be ignored silently
    encrypted = tls or any(file is not None for file in certificates)
    where = Broker.parse(
        broker,
        user=user,
        password=None if password_file is None else read_secret("--password-file", password_file),
        tls=tls_context(*certificates) if encrypted else None,
    )
    messages = known_messages(dbc or [], names(message), names(sender), names(signals), protection=False)

    def body(line: Lifeline) -> Ending:
        with Buses(watched(bus or [DEFAULT_BUS], with_errors=True), client="mqtt") as buses:
            line.ready()
            bridge = Bridge(
                buses, Board(messages), where, Topics(prefix), every_s=every_ms * 1e-3, commands=commands
            )
            run_until_signal(bridge.run())
            print(f"loaderhil: interrupted after {bridge.frames} frames", file=sys.stderr)
        return Ending.INTERRUPTED

    raise typer.Exit(ending_of(body))


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(mqtt)
