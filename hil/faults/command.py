"""`loaderhil inject`: options of the command that sends faults to the control socket of a running gateway."""

import re
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


def fault_table(said: dict[str, Any]) -> dict[str, Any]:
    """The [[fault]] table for the options that were given; `said` has None for the others."""
    given = {key: value for key, value in said.items() if value is not None}
    table: dict[str, Any] = {}
    for key, value in given.items():
        if key in ("at_s", "for_s"):
            table[key] = seconds(value)
        elif key in ("delay_ms", "jitter_ms", "gap_ms"):
            table[key] = seconds(value) * 1e3
        elif key == "interval_us":
            table[key] = seconds(value) * 1e6
        elif key == "signals":
            table[key] = value.split(",")
        elif key == "identifier":
            table[key] = _whole(value)
        else:
            table[key] = value
    return table


def _whole(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise NoSuchValue(f"--identifier {text!r} is no number; write 291 or 0x123") from None


def inject(
    kind: Annotated[
        str | None, typer.Argument(metavar="KIND", help="Kind of fault: drop, delay, freeze and others.")
    ] = None,
    message: Annotated[
        str | None,
        typer.Argument(
            metavar="MESSAGE",
            help="Messages that the fault changes: a name, the start of names, or a pattern with *.",
        ),
    ] = None,
    control: Annotated[
        Path, typer.Option("--control", metavar="PATH", help="Control socket of the gateway.")
    ] = CONTROL,
    listing: Annotated[
        bool, typer.Option("--list", help="List the faults of the gateway and their state.")
    ] = False,
    clear: Annotated[bool, typer.Option("--clear", help="End every fault, or the one of --number.")] = False,
    number: Annotated[
        int | None,
        typer.Option("--number", metavar="N", help="With --clear: end only the fault of this number."),
    ] = None,
    for_: Annotated[
        str | None,
        typer.Option(
            "--for", metavar="DURATION", help="Duration of the fault; by default until it is cleared."
        ),
    ] = None,
    in_: Annotated[
        str | None, typer.Option("--in", metavar="DURATION", help="Delay before the fault begins.")
    ] = None,
    side: Annotated[
        str | None,
        typer.Option("--from", metavar="SIDE", help="Change only the frames of this side: plant or ecu."),
    ] = None,
    probability: Annotated[
        float | None,
        typer.Option(
            "--probability",
            metavar="P",
            rich_help_panel=PARAMETERS,
            help="Probability for each frame, 0 to 1.",
        ),
    ] = None,
    delay: Annotated[
        str | None,
        typer.Option(
            "--delay", metavar="DURATION", rich_help_panel=PARAMETERS, help="For delay: by how much."
        ),
    ] = None,
    jitter: Annotated[
        str | None,
        typer.Option(
            "--jitter",
            metavar="DURATION",
            rich_help_panel=PARAMETERS,
            help="For jitter: the largest random delay.",
        ),
    ] = None,
    depth: Annotated[
        int | None,
        typer.Option(
            "--depth",
            metavar="N",
            rich_help_panel=PARAMETERS,
            help="For reorder: number of frames that overtake a frame.",
        ),
    ] = None,
    copies: Annotated[
        int | None,
        typer.Option(
            "--copies", metavar="N", rich_help_panel=PARAMETERS, help="For repeat: number of copies."
        ),
    ] = None,
    gap: Annotated[
        str | None,
        typer.Option(
            "--gap", metavar="DURATION", rich_help_panel=PARAMETERS, help="For repeat: time between copies."
        ),
    ] = None,
    bits: Annotated[
        int | None,
        typer.Option(
            "--bits", metavar="N", rich_help_panel=PARAMETERS, help="For corrupt: number of bits to flip."
        ),
    ] = None,
    valid_crc: Annotated[
        bool | None,
        typer.Option(
            "--valid-crc",
            rich_help_panel=PARAMETERS,
            help="For corrupt: compute a CRC that fits the changed bits.",
        ),
    ] = None,
    signal: Annotated[
        str | None,
        typer.Option(
            "--signal",
            metavar="NAME",
            rich_help_panel=PARAMETERS,
            help="For freeze, offset and spike: the signal to change.",
        ),
    ] = None,
    signals: Annotated[
        str | None,
        typer.Option(
            "--signals", metavar="A,B", rich_help_panel=PARAMETERS, help="For swap: the two signals."
        ),
    ] = None,
    offset: Annotated[
        float | None,
        typer.Option(
            "--offset",
            metavar="X",
            rich_help_panel=PARAMETERS,
            help="For offset: value to add, in the unit of the signal.",
        ),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            "--height",
            metavar="X",
            rich_help_panel=PARAMETERS,
            help="For spike: height, in the unit of the signal.",
        ),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            "--unit",
            metavar="UNIT",
            rich_help_panel=PARAMETERS,
            help="For offset and spike: the unit you mean; an error if the DBC has another.",
        ),
    ] = None,
    every: Annotated[
        int | None,
        typer.Option(
            "--every", metavar="N", rich_help_panel=PARAMETERS, help="For spike: change one frame in N."
        ),
    ] = None,
    interval: Annotated[
        str | None,
        typer.Option(
            "--interval",
            metavar="DURATION",
            rich_help_panel=PARAMETERS,
            help="For babble: time between frames.",
        ),
    ] = None,
    identifier: Annotated[
        str | None,
        typer.Option(
            "--identifier",
            metavar="ID",
            rich_help_panel=PARAMETERS,
            help="For babble: identifier of the frames, as 291 or 0x123.",
        ),
    ] = None,
    node: Annotated[
        str | None,
        typer.Option("--node", metavar="SIDE", rich_help_panel=PARAMETERS, help="For bus_off: plant or ecu."),
    ] = None,
    process: Annotated[
        str | None,
        typer.Option("--process", metavar="SIDE", rich_help_panel=PARAMETERS, help="For kill: plant or ecu."),
    ] = None,
) -> None:
    """Inject faults into a running gateway, list them, or end them.

    Examples: `loaderhil inject drop WheelSpeeds --probability 0.1 --for 2s`,
    `loaderhil inject offset Articulation --signal ArticulationAngle --offset 5 --unit deg`,
    `loaderhil inject --list`, `loaderhil inject --clear`
    """
    from hil.ending import Ending
    from hil.faults.control import ControlUnavailable, ask

    if (kind is not None) + listing + clear != 1:
        raise typer.BadParameter("give a kind of fault, or --list, or --clear", param_hint="KIND")
    try:
        if listing:
            _print_list(ask(control, {"command": "list"})["faults"])
        elif clear:
            cleared = ask(control, {"command": "clear"} | ({"number": number} if number is not None else {}))
            print(f"cleared: {', '.join(map(str, cleared['cleared'])) or 'no fault was active'}")
        else:
            said = {
                "kind": kind, "message": message, "from": side, "at_s": in_, "for_s": for_,
                "probability": probability, "delay_ms": delay, "jitter_ms": jitter, "depth": depth,
                "copies": copies, "gap_ms": gap, "bits": bits, "valid_crc": valid_crc, "signal": signal,
                "signals": signals, "offset": offset, "height": height, "unit": unit, "every": every,
                "interval_us": interval, "identifier": identifier, "node": node, "process": process,
            }  # fmt: skip
            answer = ask(control, {"command": "inject", "fault": fault_table(said)})
            print(f"fault {answer['number']}: {answer['fault']}")
    except ControlUnavailable as error:
        typer.echo(f"loaderhil: {error}", err=True)
        raise typer.Exit(Ending.HUB_LOST) from None


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
