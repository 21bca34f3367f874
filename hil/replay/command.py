"""`loaderhil replay`: sends a recording onto buses, or feeds it into the ECU's core."""

import contextlib
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from bus.address import open_transport
from bus.ticks import Alarm
from bus.transport import Transport
from bus.user_error import UserError
from dbc.recordings.logfile import FrameTable
from dbc.recordings.reading import read_frames
from hil.ending import Ending
from hil.faults.record import Injected, read_faults
from hil.replay.replay import Player, Progress
from hil.rundir import BUS, ECU_BUS
from hil.shell.lifeline import Lifeline
from hil.shell.process import Stop, ending_of


class ReplayError(UserError, ValueError):
    """A recording cannot be played as asked; the message says why and what would help."""


def targets(words: Sequence[str], table: FrameTable, channel: str | None, recording: Path) -> dict[str, str]:
    """Channel -> address, from addresses given as NAME=ADDRESS, or one for the chosen or only channel."""
    if channel is not None:
        table.on_channel(channel, recording)
    named = dict(word.split("=", 1) for word in words if "=" in word and ":" not in word.partition("=")[0])
    for name in named:
        table.on_channel(name, recording)
    plain = [word for word in words if word not in {f"{n}={a}" for n, a in named.items()}]
    if not plain and len(named) == len(words):
        return named
    if len(plain) > 1 or named:
        raise ReplayError("several buses: give each channel its bus as CHANNEL=ADDRESS")
    if channel is None and len(table.channels) > 1:
        raise ReplayError(
            f"{recording}: has the channels {', '.join(table.channels)}: choose one with --channel, or give each its bus as "
            "CHANNEL=ADDRESS"
        )
    return {channel or table.channels[0]: plain[0]}


def play(
    line: Lifeline, table: FrameTable, where: dict[str, str], *, speed: float | None, loop: bool, source: Path
) -> Ending:
    """Send until the end or Ctrl-C, and print a summary."""
    with contextlib.ExitStack() as stack:
        buses = {
            name: stack.enter_context(open_transport(address, name="replay"))
            for name, address in where.items()
        }
        stop = stack.enter_context(Stop())
        alarm = stack.enter_context(contextlib.closing(Alarm()))
        line.ready()
        started_ns = time.monotonic_ns()
        player = Player(table, buses, started_ns, speed=speed, loop=loop)
        complete = _run(player, list(buses.values()), stop, alarm)
        elapsed_s = (time.monotonic_ns() - started_ns) * 1e-9
    line.finished(complete=complete, sent=player.progress.sent)
    if not line.supervised:
        print(summary(source, player.progress, elapsed_s, paced=speed is not None))
    return Ending.PASSED if complete else Ending.INTERRUPTED


def _run(player: Player, buses: Sequence[Transport], stop: Stop, alarm: Alarm) -> bool:
    """Whether the recording was played to its end."""
    # a time in the past fires at once: the first frame is due now
    alarm.set(1)
    for _ in stop.readable(alarm.fileno()):
        for bus in buses:
            while bus.drain():  # frames of others are discarded: they must not fill the receive buffer
                pass
        wake_ns = player.advance(time.monotonic_ns())
        if wake_ns is None:
            return True
        alarm.set(wake_ns)
    return False


def summary(source: Path, progress: Progress, elapsed_s: float, *, paced: bool) -> str:
    """The summary of a replay in one line."""
    rounds = f" in {progress.rounds} rounds" if progress.rounds > 1 else ""
    text = f"{source}: {progress.sent} frames sent{rounds} in {elapsed_s:.3f} s"
    if paced and progress.sent:
        mean_ms = progress.total_late_ns / progress.sent * 1e-6
        text += f", mean delay {mean_ms:.2f} ms, largest {progress.largest_late_ns * 1e-6:.2f} ms"
    elif progress.sent:
        text += f", {progress.sent / max(elapsed_s, 1e-9):.0f} frames/s"
    return text + (f"; {progress.refused} waits because the bus was full" if progress.refused else "")


def compare_with_ecu(
    recording: Path,
    table: FrameTable,
    *,
    form: str,
    limits: bool,
    calibration: str,
    detect_faults: bool = False,
    faults: Sequence[Injected] = (),
) -> Ending:
    """Compare the answers of the ECU's core with the recorded ones; prints one line and returns the ending.

    faults: of the run that was recorded. A difference after one of them began is inconclusive: the ECU may have received other
    frames than those on the recorded bus.
    """
    from dbc import loader_database
    from hil.ecu_side import FORMS, ecu_cycle
    from hil.replay.into_ecu import into_ecu

    chosen = next((known for known in FORMS if known == form), None)
    if chosen is None:
        raise ReplayError(f"--form {form}: not one of {', '.join(FORMS)}")
    found = into_ecu(
        table,
        lambda: ecu_cycle(form=chosen, limits=limits, calibration=calibration, detect_faults=detect_faults),
        loader_database(),
        str(recording),
    )
    equal = f"{found.answers} answers of {found.ticks} ticks equal bit for bit"
    if found.open_ticks:
        equal += (
            f" (in {found.open_ticks} ticks the order of the frames was not recorded and had to be searched)"
        )
    if found.difference is None:
        print(f"{recording}: {equal}")
        return Ending.PASSED
    print(f"{recording}: {found.difference}; before it {equal}")
    if cause := cause_among(faults, found.difference.at_s):
        print(f"{recording}: {cause}")
        return Ending.INCONCLUSIVE
    return Ending.FAILED


def cause_among(faults: Sequence[Injected], at_s: float) -> str:
    """A sentence on the faults that may have caused a difference at `at_s` [s]; empty if none began before it."""
    # a fault that has ended counts too: the ECU's filters and counters remember it
    earlier = [f"{fault.fault} (from {fault.began_s:.2f} s)" for fault in faults if fault.began_s <= at_s]
    if not earlier:
        return ""
    return f"the run injected {', '.join(earlier)}: the ECU did not receive the frames that are recorded"


def heard_by_ecu(run: Path) -> Path:
    """The recording of a run directory with the frames that the ECU received: behind a gateway, that of its own bus."""
    return run / ECU_BUS if (run / ECU_BUS).exists() else run / BUS


def replay(
    recording: Annotated[
        Path,
        typer.Argument(metavar="RECORDING", help="Recording to send; with --into-ecu also a run directory."),
    ],
    buses: Annotated[
        list[str] | None,
        typer.Argument(metavar="[BUS]...", help="Address of the bus, or CHANNEL=ADDRESS for each channel."),
    ] = None,
    channel: Annotated[
        str | None, typer.Option("--channel", metavar="NAME", help="Send only this channel of the recording.")
    ] = None,
    message: Annotated[
        list[str] | None,
        typer.Option(
            "--message", metavar="NAME", help="Send only these messages (`Wheel*` is a pattern). Repeatable."
        ),
    ] = None,
    sender: Annotated[
        list[str] | None,
        typer.Option("--sender", metavar="NODE", help="Send only what this node sends. Repeatable."),
    ] = None,
    not_sender: Annotated[
        list[str] | None,
        typer.Option("--not-sender", metavar="NODE", help="Leave out what this node sends. Repeatable."),
    ] = None,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(
            "--dbc", metavar="FILE", help="DBC file for these names; by default the bench's own. Repeatable."
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option("--speed", min=0.001, max=1000, help="Speed as a multiple of the recorded speed.")
    ] = 1.0,
    fast: Annotated[bool, typer.Option("--fast", help="Send as fast as the bus accepts frames.")] = False,
    loop: Annotated[bool, typer.Option("--loop", help="Repeat the recording until Ctrl-C.")] = False,
    ecu: Annotated[
        bool,
        typer.Option(
            "--into-ecu",
            help="Feed the recording to the ECU's algorithm and compare its answers with the recorded ones, bit for bit.",
        ),
    ] = False,
    form: Annotated[
        str,
        typer.Option(
            "--form",
            metavar="FORM",
            help="With --into-ecu: equations of the estimators, `corrected` or `printed`.",
        ),
    ] = "corrected",
    limits: Annotated[
        bool,
        typer.Option(
            "--limits/--no-limits", help="With --into-ecu: whether the recorded ECU limited the machine."
        ),
    ] = True,
    detect_faults: Annotated[
        bool,
        typer.Option(
            "--detect-faults/--no-detect-faults",
            help="With --into-ecu: whether the recorded ECU tested its sensors against each other.",
        ),
    ] = False,
    calibration: Annotated[
        str,
        typer.Option(
            "--calibration", metavar="NAME|FILE", help="With --into-ecu: calibration of the recorded ECU."
        ),
    ] = "l60",
) -> None:
    """Send a recording to a bus with its recorded timing, or feed it to the ECU.

    Examples: `loaderhil replay drive.blf socketcan:can0 --channel can1`,
    `loaderhil replay both.log front=hub:/tmp/a rear=hub:/tmp/b --speed 2`, `loaderhil replay out/loaded --into-ecu`
    """
    if ecu == bool(buses):
        raise ReplayError("no destination: give one or more buses, or --into-ecu")
    faults: Sequence[Injected] = ()
    # the run's own form, limits, calibration and detection: others would differ from the recorded answers at once
    if recording.is_dir() and ecu:
        from hil.rundir import read_record

        record = read_record(recording)
        form, limits, calibration = record.form, record.limits, record.calibration
        detect_faults = record.detect_faults
        faults = read_faults(recording)
        recording = heard_by_ecu(recording)
    table = read_frames(recording)
    for damage in table.damaged:
        typer.echo(f"{recording}: {damage}", err=True)
    if ecu:
        chosen = table.on_channel(channel, recording) if channel is not None else table
        raise typer.Exit(
            compare_with_ecu(
                recording,
                chosen,
                form=form,
                limits=limits,
                calibration=calibration,
                detect_faults=detect_faults,
                faults=faults,
            )
        )
    if message or sender or not_sender or dbc:
        from dbc import loader_database
        from dbc.database import Database
        from hil.replay.choice import chosen_part

        databases = [Database.from_file(file, strict=False) for file in dbc or []] or [loader_database()]
        table = chosen_part(table, databases, message or [], sender or [], not_sender or [])
    where = targets(buses or [], table, channel, recording)
    pace = None if fast else speed
    raise typer.Exit(
        ending_of(lambda line: play(line, table, where, speed=pace, loop=loop, source=recording))
    )


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(replay)
