"""`loaderhil monitor`: its options, and what of them goes together."""

import sys
from contextlib import ExitStack
from typing import Annotated

import typer

from bus.mistake import Mistake

DEFAULT = "hub:/tmp/loaderhil.hub"


class OptionError(Mistake, ValueError):
    """Options that do not go together."""


def monitor(
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="BUS|FILE...",
            help="hub:PATH, socketcan:INTERFACE or just its name, `any`, or recordings (`-`: standard input), "
            f"each with candump's filters behind commas. By default {DEFAULT}.",
        ),
    ] = None,
    raw: Annotated[bool, typer.Option("--raw", help="Lines as candump prints them.")] = False,
    follow: Annotated[
        bool, typer.Option("--follow", "-f", help="Go on while the recording grows, like `tail -f`.")
    ] = False,
    count: Annotated[
        int | None, typer.Option("--count", "-n", min=1, help="End after that many frames.")
    ] = None,
    silence_ms: Annotated[
        int | None, typer.Option("--silence-ms", "-T", min=1, help="End after that long without a frame.")
    ] = None,
    stamp: Annotated[
        str,
        typer.Option("-t", metavar="a|A|d|z", help="raw: time, with date, since the last, since the first."),
    ] = "",
    log_format: Annotated[bool, typer.Option("-L", help="raw: candump's log format.")] = False,
    log: Annotated[
        bool, typer.Option("-l", help="raw: into a log candump-DATE_TIME.log, not shown.")
    ] = False,
    extra: Annotated[bool, typer.Option("-x", help="raw: RX or TX, and CAN FD flags.")] = False,
    text: Annotated[bool, typer.Option("-a", help="raw: data also as text.")] = False,
    binary: Annotated[bool, typer.Option("-i", help="raw: data in bits.")] = False,
    swapped: Annotated[bool, typer.Option("-S", help="raw: data in reverse, marked with `.")] = False,
    drops: Annotated[bool, typer.Option("-d", help="raw: tell lost frames among the lines.")] = False,
    colour: Annotated[
        int, typer.Option("-c", count=True, help="raw: colour per interface; more with -cc, -ccc.")
    ] = 0,
) -> None:
    """Follow buses, or show recordings.

    Examples: `loaderhil monitor can0,123:7FF can1 --raw -t a` or `loaderhil monitor drive.log --raw -L -f`
    """
    from hil.monitor.candump import Stamp, Style
    from hil.monitor.raw import LogFile, RawView
    from hil.monitor.run import Plan, View, monitor
    from hil.monitor.source import Source
    from hil.monitor.target import Target
    from hil.processes.shell import ending_of

    if stamp not in list(Stamp):
        raise typer.BadParameter(f"'{stamp}' is not one of a, A, d, z", param_hint="-t")
    style = Style(
        stamp=Stamp(stamp),
        log=log_format,
        extra=extra,
        text=text,
        binary=binary,
        swapped=swapped,
        colour=colour,
    )
    if log_format and (text or binary or swapped):
        raise OptionError("-L has no room for -a, -i or -S; leave one out")
    plan = Plan(
        targets=tuple(Target.parse(target) for target in targets or [DEFAULT]),
        follow=follow,
        origins=extra,
        count=count,
        silence_s=None if silence_ms is None else silence_ms * 1e-3,
    )

    def view_of(source: Source, stack: ExitStack) -> View:
        if not log:
            return RawView(style, source, drops=drops)
        file = stack.enter_context(LogFile(style, source))
        print(f"loaderhil: logging into {file.path}", file=sys.stderr)
        return file

    raise typer.Exit(ending_of(lambda _: monitor(plan, view_of)))


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(monitor)
