"""`loaderhil compile`: the machine code of plant and ECU made ahead, so that no run, test or process start waits for it.

Both take a minute at their first use. Here they are compiled at the same time, each by a process of its own.
"""

import multiprocessing
import signal
import tempfile
import time
from collections.abc import Sequence
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Annotated, Final

import typer

from dbc import loader_database
from dbc.columns import ColumnDecoder
from dbc.offline.decoding import decode_log
from dbc.recordings.reading import read_frames
from hil.compose import Choice
from hil.ecu_side import ecu_cycle
from hil.ending import Ending
from hil.processes.plant import compile_plant
from hil.recording.formats import open_writer
from hil.recording.ring import records_of
from hil.rundir import BUS
from hil.runs import run_lockstep
from loaderhil.console import console

SHORT_S: Final = 0.1  # of a run that needs code only
RECORDED_S: Final = 20.0  # of a run that can be diagnosed
SCENARIO: Final = "standstill"
EFFECT: Final = "aerodynamic_drag"
"""Any effect with a compiled function: the plant with effects is compiled once for all of them."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("compile")(compile_ahead)


def compile_ahead(
    everything: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Also the plant with effects, the diagnosis of the loader, the printed equations and the test of sensors.",
        ),
    ] = False,
) -> None:
    """Compile plant and ECU ahead, at the same time, so that the next run starts at once.

    The code is kept until a source changes. What is compiled already costs some seconds.
    """
    begin = time.monotonic()
    spawn = multiprocessing.get_context("spawn")
    steps = [
        spawn.Process(target=_ecu, args=(everything,), name="ECU"),
        spawn.Process(target=_plant, args=(everything,), name="plant"),
    ]
    _start(steps)
    try:
        with console.status("compiling ECU and plant"):
            _wait_for(steps, begin)
        with console.status("compiling what reads and writes recordings"):
            _rest(everything)
    finally:
        for step in steps:
            step.kill()  # only after Ctrl-C or an error is one still running; what it has compiled by then is kept
    _report("recordings and diagnosis" if everything else "recordings", begin)


def _start(steps: Sequence[BaseProcess]) -> None:
    """Start processes that leave Ctrl-C to this one; else each would print a traceback."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # a process keeps what is ignored at its start
    try:
        for step in steps:
            step.start()
    finally:
        signal.signal(signal.SIGINT, before)


def _wait_for(steps: Sequence[BaseProcess], begin: float) -> None:
    running = list(steps)
    while running:
        wait([step.sentinel for step in running])
        for step in [step for step in running if not step.is_alive()]:
            running.remove(step)
            if step.exitcode:
                how = f"signal {-step.exitcode}" if step.exitcode < 0 else f"exit code {step.exitcode}"
                typer.echo(f"loaderhil: the process that compiles the {step.name} ended with {how}", err=True)
                raise typer.Exit(Ending.PEER_DIED)
            _report(step.name, begin)


def _report(name: str, begin: float) -> None:
    console.print(f"{name}: compiled after {time.monotonic() - begin:.0f} s")


def _ecu(everything: bool) -> None:
    ecu_cycle(form="corrected", limits=True).warm_up()
    if everything:
        ecu_cycle(form="corrected", limits=True, detect_faults=True).warm_up()
        ecu_cycle(form="printed", limits=True).warm_up()


def _plant(everything: bool) -> None:
    compile_plant(Choice(scenario=SCENARIO).load())
    if everything:
        compile_plant(Choice(scenario=SCENARIO, changes=(f"machine.effects.{EFFECT}={{}}",)).load())


def _rest(everything: bool) -> None:
    """What only a whole run compiles, and what reads it."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        duration_s = RECORDED_S if everything else SHORT_S
        run_lockstep(Choice(scenario=SCENARIO, changes=(f"duration_s={duration_s}",)), run)
        _decoding(run)
        if everything:
            # here, because both processes import this module and neither needs the diagnosis
            from discrepancy.estimation.problem import Problem
            from discrepancy.models.loader import model as loader

            recording = loader.load_run(run)
            problem = Problem(loader.model([recording]), [recording])
            start, [parameter] = problem.start(), problem.model.effect(EFFECT).parameters
            problem.predict(start)
            problem.predict(start.with_shared({parameter.name: parameter.typical}))


def _decoding(run: Path) -> None:
    """What reads candump logs and BLF, and decodes them."""
    table, blf = read_frames(run / BUS), run / "bus.blf"
    writer = open_writer(blf, table.channels)
    writer.write(records_of(list(table.frames())))
    writer.close()
    for recording in (run / BUS, blf):
        decode_log(recording, ColumnDecoder(loader_database()), take=lambda frames, decoded: None)
