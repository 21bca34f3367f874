"""`loaderhil inject`: the command that sends faults to the control socket of a running gateway."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from bus.user_error import UserError

CONTROL = Path("/tmp/loaderhil.control")  # a Unix socket; every user can name another
UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0}
PARAMETERS = "Parameters of the fault"


class NoSuchValue(UserError, ValueError):
    """An option is neither a number nor a duration."""


def seconds(text: str) -> float:
    """`2s`, `250ms`, `300us` or `1.5min` as seconds."""
    match = re.fullmatch(r"([0-9]*\.?[0-9]+)\s*(us|ms|s|min)", text)
    if match is None:
        raise NoSuchValue(f"{text!r} is no duration; write a number and us, ms, s or min, such as 250ms")
    return float(match[1]) * UNITS[match[2]]


def _milliseconds(text: str) -> float:
    return seconds(text) * 1e3


def _microseconds(text: str) -> float:
    return seconds(text) * 1e6


def _names(text: str) -> list[str]:
    return text.split(",")


def _whole(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise NoSuchValue(f"--identifier {text!r} is no number; write 291 or 0x123") from None


READ: Mapping[str, Callable[[str], Any]] = {
    "at_s": seconds,
    "for_s": seconds,
    "delay_ms": _milliseconds,
    "jitter_ms": _milliseconds,
    "gap_ms": _milliseconds,
    "interval_us": _microseconds,
    "signals": _names,
    "identifier": _whole,
}
"""Keys of a [[fault]] table whose option is a text of another form: durations carry their unit on the command line."""

KEYS: Mapping[str, str] = {
    "in_": "at_s",
    "for_": "for_s",
    "side": "from",
    "delay": "delay_ms",
    "jitter": "jitter_ms",
    "gap": "gap_ms",
    "interval": "interval_us",
}
"""Parameters of `inject` that are named otherwise than the key of the [[fault]] table that they fill."""

NOT_OF_THE_FAULT = ("control", "listing", "clear", "number")
"""Parameters of `inject` that choose the action and the gateway."""


def fault_table(given: Mapping[str, Any]) -> dict[str, Any]:
    """The [[fault]] table of the options by key; None stands for an option that was not given."""
    return {
        key: READ[key](value) if key in READ else value for key, value in given.items() if value is not None
    }


def _parameter(name: str, metavar: str | None, text: str) -> Any:
    """An option for a parameter that only some kinds of fault have; `text` begins with those kinds."""
    return typer.Option(name, metavar=metavar, rich_help_panel=PARAMETERS, help=text)


# The options, by name and with their help, so that the signature of the command stays short enough to read.
Kind = Annotated[
    str | None, typer.Argument(metavar="KIND", help="Kind of fault: drop, delay, freeze and others.")
]
Message = Annotated[
    str | None,
    typer.Argument(
        metavar="MESSAGE",
        help="Messages that the fault changes: a name, the start of names, or a pattern with *.",
    ),
]
Control = Annotated[Path, typer.Option("--control", metavar="PATH", help="Control socket of the gateway.")]
Listing = Annotated[bool, typer.Option("--list", help="List the faults of the gateway and their state.")]
Clear = Annotated[bool, typer.Option("--clear", help="End every fault, or the one of --number.")]
Number = Annotated[
    int | None, typer.Option("--number", metavar="N", help="With --clear: end only the fault of this number.")
]
For = Annotated[
    str | None,
    typer.Option("--for", metavar="DURATION", help="Duration of the fault; by default until it is cleared."),
]
In = Annotated[str | None, typer.Option("--in", metavar="DURATION", help="Delay before the fault begins.")]
From = Annotated[
    str | None,
    typer.Option("--from", metavar="SIDE", help="Change only the frames of this side: plant or ecu."),
]
Probability = Annotated[float | None, _parameter("--probability", "P", "Probability for each frame, 0 to 1.")]
Delay = Annotated[str | None, _parameter("--delay", "DURATION", "For delay: by how much.")]
Jitter = Annotated[str | None, _parameter("--jitter", "DURATION", "For jitter: the largest random delay.")]
Depth = Annotated[
    int | None, _parameter("--depth", "N", "For reorder: number of frames that overtake a frame.")
]
Copies = Annotated[int | None, _parameter("--copies", "N", "For repeat: number of copies.")]
Gap = Annotated[str | None, _parameter("--gap", "DURATION", "For repeat: time between copies.")]
Bits = Annotated[int | None, _parameter("--bits", "N", "For corrupt: number of bits to flip.")]
Content = Annotated[
    str | None,
    _parameter(
        "--content",
        "CONTENT",
        "For corrupt: the whole payload instead of single bits: random, zeros, ones, or any of them.",
    ),
]
ValidCrc = Annotated[
    bool | None,
    _parameter("--valid-crc", None, "For corrupt: compute a CRC that fits the changed bits."),
]
Signal = Annotated[
    str | None, _parameter("--signal", "NAME", "For freeze, offset and spike: the signal to change.")
]
Signals = Annotated[str | None, _parameter("--signals", "A,B", "For swap: the two signals.")]
Offset = Annotated[
    float | None, _parameter("--offset", "X", "For offset: value to add, in the unit of the signal.")
]
Height = Annotated[float | None, _parameter("--height", "X", "For spike: height, in the unit of the signal.")]
Unit = Annotated[
    str | None,
    _parameter("--unit", "UNIT", "For offset and spike: the unit you mean; an error if the DBC has another."),
]
Every = Annotated[int | None, _parameter("--every", "N", "For spike: change one frame in N.")]
Interval = Annotated[str | None, _parameter("--interval", "DURATION", "For babble: time between frames.")]
Identifier = Annotated[
    str | None, _parameter("--identifier", "ID", "For babble: identifier of the frames, as 291 or 0x123.")
]
Node = Annotated[str | None, _parameter("--node", "SIDE", "For bus_off: plant or ecu.")]
Process = Annotated[str | None, _parameter("--process", "SIDE", "For kill: plant or ecu.")]


def inject(
    context: typer.Context,
    kind: Kind = None,
    message: Message = None,
    control: Control = CONTROL,
    listing: Listing = False,
    clear: Clear = False,
    number: Number = None,
    for_: For = None,
    in_: In = None,
    side: From = None,
    probability: Probability = None,
    delay: Delay = None,
    jitter: Jitter = None,
    depth: Depth = None,
    copies: Copies = None,
    gap: Gap = None,
    bits: Bits = None,
    content: Content = None,
    valid_crc: ValidCrc = None,
    signal: Signal = None,
    signals: Signals = None,
    offset: Offset = None,
    height: Height = None,
    unit: Unit = None,
    every: Every = None,
    interval: Interval = None,
    identifier: Identifier = None,
    node: Node = None,
    process: Process = None,
) -> None:
    """Inject faults into a running gateway, list them, or end them.

    Examples: `loaderhil inject drop WheelSpeeds --probability 0.1 --for 2s`,
    `loaderhil inject offset Articulation --signal ArticulationAngle --offset 5 --unit deg`,
    `loaderhil inject --list`, `loaderhil inject --clear`
    """
    # imported here: `loaderhil --help` lists the commands without loading the sockets and the JSON reader
    from hil.ending import Ending
    from hil.faults.control import ControlUnavailable, ask

    if (kind is not None) + listing + clear != 1:
        raise typer.BadParameter("give a kind of fault, or --list, or --clear", param_hint="KIND")
    try:
        if listing:
            _print_list(ask(control, {"command": "list"})["faults"])
        elif clear:
            chosen = {"number": number} if number is not None else {}
            cleared = ask(control, {"command": "clear", **chosen})["cleared"]
            print(f"cleared: {', '.join(map(str, cleared)) or 'no fault was active'}")
        else:
            answer = ask(control, {"command": "inject", "fault": fault_table(_given(context))})
            print(f"fault {answer['number']}: {answer['fault']}")
    except ControlUnavailable as error:
        typer.echo(f"loaderhil: {error}", err=True)
        raise typer.Exit(Ending.HUB_LOST) from None


def _given(context: typer.Context) -> dict[str, Any]:
    """The options that describe the fault, by their key in the [[fault]] table.

    The gateway checks them against the kind of fault: it alone knows its DBC.
    """
    # in the order of the declaration: click keeps the values in that of the command line, and a fault's
    # description should not depend on it
    names = [parameter.name or "" for parameter in context.command.params]
    return {KEYS.get(name, name): context.params.get(name) for name in names if name not in NOT_OF_THE_FAULT}


def _print_list(faults: list[dict[str, Any]]) -> None:
    if not faults:
        print("no fault")
    for fault in faults:
        times = {
            "waiting": f"begins in {fault['begins_in_s']:.1f} s",
            "active": _remaining(fault["ends_in_s"]),
        }
        state = times.get(fault["phase"], "over")
        print(f"{fault['number']:>4}  {state:<18}  {fault['struck']:>8} frames  {fault['fault']}")


def _remaining(ends_in_s: float | None) -> str:
    return "active" if ends_in_s is None else f"ends in {ends_in_s:.1f} s"


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(inject)
