"""`loaderhil monitor`: the options of the command and the check of their combinations."""

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bus.user_error import UserError
from hil.monitor.candump import Stamp, Style
from hil.monitor.choice import known_messages, names, watched
from hil.monitor.raw import LogFile, RawView
from hil.monitor.run import Plan, View
from hil.monitor.source import Source

if TYPE_CHECKING:
    from hil.monitor.messages import Messages

DEFAULT = "hub:/tmp/loaderhil.hub"
_RAW_ONLY = ("-L", "-l", "-x", "-a", "-i", "-S", "-d", "-c")


class OptionError(UserError, ValueError):
    """Options that do not go together."""


class Form(StrEnum):
    """The form of the output; the value is the option that chooses it."""

    RAW = "--raw"
    LINES = "--lines"
    JSON = "--json"
    TABLE = "--table"


def monitor(
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="BUS|FILE...",
            help="Buses (hub:PATH, socketcan:INTERFACE, the interface's name alone, or `any`) or recordings (`-`: standard "
            f"input). Candump's filters may follow each after a comma. By default {DEFAULT}.",
        ),
    ] = None,
    raw: Annotated[bool, typer.Option("--raw", help="Print lines in candump's format.")] = False,
    lines: Annotated[
        bool, typer.Option("--lines", help="Print one decoded line per frame; the default in a pipe.")
    ] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object per frame, one per line.")
    ] = False,
    table: Annotated[
        bool,
        typer.Option(
            "--table",
            help="Show a table with one row per message, updated as frames arrive; the default on a terminal. In a pipe: once, at the end.",
        ),
    ] = False,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(
            "--dbc",
            metavar="FILE",
            help="DBC file; by default the bench's own and a few J1939 parameter groups. Repeatable.",
        ),
    ] = None,
    message: Annotated[
        list[str] | None,
        typer.Option(
            "--message",
            "-m",
            metavar="NAME",
            help="Show only messages of this name. Repeatable; shell patterns.",
        ),
    ] = None,
    sender: Annotated[
        list[str] | None,
        typer.Option(
            "--sender",
            metavar="NODE",
            help="Show only messages that this node sends. Repeatable; shell patterns.",
        ),
    ] = None,
    signals: Annotated[
        list[str] | None,
        typer.Option(
            "--signals",
            "-s",
            metavar="A,B",
            help="Show only these signals, as Signal or Message.Signal; shell patterns.",
        ),
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", "-f", help="Continue while the recording grows, like `tail -f`.")
    ] = False,
    count: Annotated[
        int | None, typer.Option("--count", "-n", min=1, help="End after this number of frames.")
    ] = None,
    silence_ms: Annotated[
        int | None,
        typer.Option("--silence-ms", "-T", min=1, help="End after this time without a frame [ms]."),
    ] = None,
    stamp: Annotated[
        str | None,
        typer.Option(
            "-t",
            metavar="a|A|d|z",
            help="Time at the start of a line: a absolute, A with date, d since the previous frame, z since the first frame.",
        ),
    ] = None,
    log_format: Annotated[bool, typer.Option("-L", help="With --raw: candump's log format.")] = False,
    log: Annotated[
        bool, typer.Option("-l", help="With --raw: write a log file candump-DATE_TIME.log and show nothing.")
    ] = False,
    extra: Annotated[
        bool, typer.Option("-x", help="With --raw: show RX or TX, and the CAN FD flags.")
    ] = False,
    text: Annotated[bool, typer.Option("-a", help="With --raw: show the data also as text.")] = False,
    binary: Annotated[bool, typer.Option("-i", help="With --raw: show the data as bits.")] = False,
    swapped: Annotated[
        bool, typer.Option("-S", help="With --raw: show the bytes in reverse order, separated by `.")
    ] = False,
    drops: Annotated[
        bool, typer.Option("-d", help="With --raw: report lost frames between the lines.")
    ] = False,
    colour: Annotated[
        int,
        typer.Option(
            "-c",
            count=True,
            help="With --raw: one colour per interface; -cc and -ccc colour more of the line.",
        ),
    ] = 0,
) -> None:
    """Show the frames of buses or recordings: as a table, as decoded lines, or as candump prints them.

    Examples: `loaderhil monitor can0`, `loaderhil monitor drive.blf --lines --signals 'Wheel*.Left'`,
    `loaderhil monitor can0,123:7FF can1 --raw -t a`, `loaderhil monitor can0 --json | jq .signals`
    """
    from hil.monitor.run import monitor
    from hil.shell.process import ending_of

    # the letters of candump's options are kept, so that its users need not learn others
    form = _form(raw=raw, lines=lines, json=json, table=table)
    used = (log_format, log, extra, text, binary, swapped, drops, colour)
    _check_raw_options(form, [name for name, value in zip(_RAW_ONLY, used, strict=True) if value])
    plan = Plan(
        targets=watched(targets or [DEFAULT], with_errors=form is not Form.RAW),
        follow=follow,
        origins=extra,
        count=count,
        silence_s=None if silence_ms is None else silence_ms * 1e-3,
    )
    style = Style(
        stamp=_stamp(stamp),
        log=log_format,
        extra=extra,
        text=text,
        binary=binary,
        swapped=swapped,
        colour=colour,
    )
    view_of: Callable[[Source, ExitStack], View]
    if form is Form.RAW:
        view_of = _raw_view(style, log=log, drops=drops)
    else:
        stamps = Stamp.ABSOLUTE if stamp is None else style.stamp
        known = known_messages(
            # the table has no room for CRC and counter of every message; lines and JSON show them
            dbc or [],
            names(message),
            names(sender),
            names(signals),
            protection=form is not Form.TABLE,
        )
        view_of = _decoded_view(form, known, stamps, plan)
    raise typer.Exit(ending_of(lambda _: monitor(plan, view_of)))


def _form(*, raw: bool, lines: bool, json: bool, table: bool) -> Form:
    """The chosen form; by default a table on a terminal and lines in a pipe."""
    asked = [form for form, wanted in zip(Form, (raw, lines, json, table), strict=True) if wanted]
    if len(asked) > 1:
        raise OptionError(f"{' and '.join(asked)}: choose one")
    if asked:
        return asked[0]
    return Form.TABLE if _on_terminal() else Form.LINES


def _on_terminal() -> bool:
    # a dumb terminal cannot move the cursor: the table would be printed again and again
    return sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def _check_raw_options(form: Form, used: Sequence[str]) -> None:
    if used and form is not Form.RAW:
        raise OptionError(f"{', '.join(used)}: only with --raw")
    if "-L" in used and {"-a", "-i", "-S"} & set(used):
        raise OptionError("-L has no room for -a, -i or -S; leave one out")


def _stamp(text: str | None) -> Stamp:
    if text is not None and text not in ("a", "A", "d", "z"):
        raise typer.BadParameter(f"'{text}' is not one of a, A, d, z", param_hint="-t")
    return Stamp(text or "")


def _raw_view(style: Style, *, log: bool, drops: bool) -> Callable[[Source, ExitStack], View]:
    def view_of(source: Source, stack: ExitStack) -> View:
        if not log:
            return RawView(style, source, drops=drops)
        file = stack.enter_context(LogFile(style, source))
        print(f"loaderhil: logging into {file.path}", file=sys.stderr)
        return file

    return view_of


def _decoded_view(
    form: Form, messages: "Messages", stamp: Stamp, plan: Plan
) -> Callable[[Source, ExitStack], View]:
    def view_of(source: Source, _: ExitStack) -> View:
        if form is Form.TABLE:
            return _table_view(messages, source, plan)
        from hil.monitor.decoded import JsonView, LinesView

        return JsonView(messages) if form is Form.JSON else LinesView(messages, stamp)

    return view_of


def _table_view(messages: "Messages", source: Source, plan: Plan) -> View:
    """A table that is redrawn on a terminal while frames come, or printed once at the end."""
    from rich.console import Console

    from hil.monitor.live import LiveView, TableView

    console = Console(highlight=False)
    # a finished recording is read in a moment: a live table of it would flicker once
    lasting = plan.follow or all(target.path is None for target in plan.targets)
    title = ", ".join(target.name for target in plan.targets)
    kind = LiveView if lasting and _on_terminal() else TableView
    return kind(messages, source, title, console)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(monitor)
