"""`loaderhil plant`, `ecu` and `hub`: the options of the processes of a bench that are started by hand or by the supervisor.

Each command imports its process when it runs: the hub loads neither plant nor ECU.
"""

from pathlib import Path
from typing import Annotated

import typer

from hil.shell.realtime_options import CpuOption, FifoOption, FreezeOption, LockOption, RealtimeOptions
from loaderhil.options import (
    DEFAULT_BUS,
    BusOption,
    DetectOption,
    FormOption,
    LimitsOption,
    PayloadOption,
    SeedOption,
    SetOption,
    checked_core,
    checked_form,
)


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    for command in (plant, ecu, hub):
        app.command()(command)


def plant(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="A name from `loaderhil scenarios`, or a TOML file.")
    ],
    bus: BusOption = DEFAULT_BUS,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for the true states and the timing.")
    ] = None,
    payload_kg: PayloadOption = None,
    seed: SeedOption = None,
    changes: SetOption = None,
    fmu: Annotated[
        Path | None,
        typer.Option(
            "--fmu",
            metavar="FILE.fmu",
            help="FMU that moves in place of the simulated machine; driver, limits and sensors stay.",
        ),
    ] = None,
    fifo: FifoOption = None,
    lock_memory: LockOption = False,
    cpu: CpuOption = None,
    gc_freeze: FreezeOption = True,
) -> None:
    """Start the simulated machine as a process, until its scenario ends.

    Example, against a real ECU: `loaderhil plant loaded --bus socketcan:can0`
    """
    from hil.compose import Choice
    from hil.processes import plant as process
    from hil.shell.process import ending_of

    choice = Choice(
        scenario=scenario, payload_kg=payload_kg, seed=seed, changes=tuple(changes or ()), fmu=fmu
    )
    realtime = RealtimeOptions(fifo=fifo, lock_memory=lock_memory, cpu=cpu, gc_freeze=gc_freeze)
    # the lifeline is opened by `ending_of`: a supervisor learns of an error in the body as well
    raise typer.Exit(ending_of(lambda line: process.run(line, choice, bus, out, realtime)))


def ecu(
    bus: BusOption = DEFAULT_BUS,
    form: FormOption = "corrected",
    limits: LimitsOption = True,
    calibration: Annotated[
        str,
        typer.Option(
            "--calibration",
            metavar="NAME|FILE",
            help="Calibration: the machine parameters that the ECU works with.",
        ),
    ] = "l60",
    detect_faults: DetectOption = True,
    core: Annotated[
        str,
        typer.Option(
            "--core",
            metavar="CORE",
            help="What computes: `python`, or `c`, the exported C built with this computer's compiler.",
        ),
    ] = "python",
    xcp: Annotated[
        str | None,
        typer.Option(
            "--xcp",
            metavar="TOOL,ECU",
            help="Offer measuring and calibrating by XCP on these two CAN identifiers, such as 0x18EF80F9,0x18EFF980.",
        ),
    ] = None,
    uds: Annotated[
        str | None,
        typer.Option(
            "--uds",
            metavar="TOOL,ECU",
            help="Offer diagnosis by UDS on ISO-TP on these two CAN identifiers, such as 0x18DA80F1,0x18DAF180.",
        ),
    ] = None,
    j1939: Annotated[
        str | None,
        typer.Option(
            "--j1939",
            metavar="NAME",
            help="Claim the ECU's address by J1939-81 with this NAME, such as identity=1,manufacturer=0, and answer requests; without the address the ECU sends nothing.",
        ),
    ] = None,
    access_key: Annotated[
        Path | None,
        typer.Option(
            "--access-key",
            metavar="FILE",
            help="File with the secret behind seed and key; without it a tool can read, and change nothing.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for the timing.")] = None,
    fifo: FifoOption = None,
    lock_memory: LockOption = False,
    cpu: CpuOption = None,
    gc_freeze: FreezeOption = True,
) -> None:
    """Start the virtual ECU as a process, until Ctrl-C.

    Example: `loaderhil ecu --bus socketcan:can0 --fifo 50 --lock-memory --cpu 1`
    """
    from ecu.offered.services import ServiceOptions
    from hil.processes import ecu as process
    from hil.shell.process import ending_of

    # before the process is started: a wrong name is an error of the command line
    checked, computing = checked_form(form), checked_core(core, "--core", lockstep=False)
    realtime = RealtimeOptions(fifo=fifo, lock_memory=lock_memory, cpu=cpu, gc_freeze=gc_freeze)
    services = ServiceOptions(xcp=xcp, uds=uds, j1939=j1939, access_key=access_key)
    raise typer.Exit(
        ending_of(
            lambda line: process.run(
                line, checked, limits, bus, out, realtime, calibration, detect_faults, computing, services
            )
        )
    )


def hub(
    bus: BusOption = DEFAULT_BUS,
    bit_rate: Annotated[
        int | None,
        typer.Option(
            # 5 kbit/s is the slowest common CAN rate, 20 Mbit/s that of CAN XL: beyond them it is another unit
            "--bit-rate",
            min=5_000,
            max=20_000_000,
            help="Delay frames as a real bus of this bit rate does [bit/s]; by default no delay.",
        ),
    ] = None,
    data_bit_rate: Annotated[
        int | None,
        typer.Option(
            "--data-bit-rate",
            min=5_000,
            max=20_000_000,
            help="Bit rate of the data phase of CAN FD frames that switch it [bit/s].",
        ),
    ] = None,
    status: Annotated[
        bool,
        typer.Option("--status", help="List the clients of a running hub and their lost frames, and end."),
    ] = False,
    fifo: FifoOption = None,
    lock_memory: LockOption = False,
    cpu: CpuOption = None,
    gc_freeze: FreezeOption = True,
) -> None:
    """Start a CAN bus for computers without CAN hardware, until Ctrl-C.

    Processes of this computer join the bus through a Unix socket. Examples: `loaderhil hub --bit-rate 500000 --data-bit-rate 2000000`, and beside it `loaderhil hub --status`
    """
    from hil.processes import hub as process
    from hil.shell.process import ending_of

    # before the real-time options: a query of counters needs none
    if status:
        raise typer.Exit(ending_of(lambda line: process.print_status(bus)))
    realtime = RealtimeOptions(fifo=fifo, lock_memory=lock_memory, cpu=cpu, gc_freeze=gc_freeze)
    # both in one object: a data rate without a bit rate is refused there
    rates = process.BitRates(bit_rate, data_bit_rate)
    raise typer.Exit(ending_of(lambda line: process.run(line, bus, rates, realtime)))
