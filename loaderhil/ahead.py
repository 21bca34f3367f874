"""`loaderhil compile`: the machine code of plant and ECU made ahead, so that no run, test or process start waits for it.

Each part takes up to a minute and a half at its first use. Here parts are compiled at the same time, each by a process of its own.
"""

import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from dbc import loader_database
from dbc.columns import ColumnDecoder
from dbc.offline.decoding import decode_log
from dbc.recordings.reading import read_frames
from deploy.c.library import NoCompilerError, library
from ecu.calibration import CALIBRATIONS, load_calibration
from ecu.detection.live import Detection
from ecu.estimators.columns import BLOCK, estimate_columns
from ecu.inputs import CycleInputs, InputReceiver, estimator_inputs
from ecu.outputs import TICK_NS
from hil.compose import Choice
from hil.ecu_side import ecu_cycle
from hil.ending import Ending
from hil.processes.plant import compile_plant
from hil.recording.formats import open_writer
from hil.recording.ring import records_of
from hil.rundir import BUS
from hil.runs import run_lockstep
from loaderhil.console import console

AT_LEAST: Final = 2
"""Parts compiled at a time, also on one processor, where it costs nothing."""
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
            help="Also the plant with effects, the diagnosis of the loader, the estimates of whole recordings and the printed equations.",
        ),
    ] = False,
) -> None:
    """Compile plant and ECU ahead, at the same time, so that the next run starts at once.

    The code is kept until a source changes. What is compiled already costs some seconds.
    """
    begin = time.monotonic()
    spawn = multiprocessing.get_context("spawn")
    chosen = [part for part in PARTS if everything or not part.rarely]
    steps = [spawn.Process(target=part.compile, name=part.name) for part in chosen]
    try:
        with console.status(f"compiling {', '.join(part.name for part in chosen)}"):
            _run(steps, begin)
        with console.status("compiling what reads and writes recordings"):
            _rest(everything)
    finally:
        for step in steps:
            if step.pid is not None:
                step.kill()  # only after Ctrl-C or an error is one still running; what it has compiled by then is kept
    _report("recordings and diagnosis" if everything else "recordings", begin)


def _run(steps: Sequence[BaseProcess], begin: float) -> None:
    """All steps, as many at a time as there are processors."""
    waiting, running = list(steps), list[BaseProcess]()
    while waiting or running:
        while waiting and len(running) < max(AT_LEAST, len(os.sched_getaffinity(0))):
            running.append(waiting.pop(0))
            _start(running[-1])
        wait([step.sentinel for step in running])
        for step in [step for step in running if not step.is_alive()]:
            running.remove(step)
            if step.exitcode:
                how = f"signal {-step.exitcode}" if step.exitcode < 0 else f"exit code {step.exitcode}"
                typer.echo(f"loaderhil: the process that compiles the {step.name} ended with {how}", err=True)
                raise typer.Exit(Ending.PEER_DIED)
            _report(step.name, begin)


def _start(step: BaseProcess) -> None:
    """Start a process that leaves Ctrl-C to this one; else it would print a traceback."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # a process keeps what is ignored at its start
    try:
        step.start()
    finally:
        signal.signal(signal.SIGINT, before)


def _report(name: str, begin: float) -> None:
    console.print(f"{name}: compiled after {time.monotonic() - begin:.0f} s")


def _ecu() -> None:
    ecu_cycle(form="corrected", limits=True).warm_up()


def _ecu_in_c() -> None:
    """The libraries that a run in lockstep takes where they are there; without a compiler it takes the Python core."""
    with suppress(NoCompilerError):
        for calibration in sorted(CALIBRATIONS.glob("*.toml")):
            library(load_calibration(calibration))


def _printed() -> None:
    ecu_cycle(form="printed", limits=True).warm_up()


def _tables() -> None:
    """The estimators over whole recordings: as many rows as need the code of large tables."""
    row = estimator_inputs(_before_any_frame(), TICK_NS * 1e-9, 1.0)
    estimate_columns(np.tile(row, (2 * BLOCK, 1)), load_calibration().parameters)


def _test_of_sensors() -> None:
    Detection(load_calibration(), loader_database()).look(_before_any_frame(), TICK_NS * 1e-9, 0)


def _before_any_frame() -> CycleInputs:
    return InputReceiver(load_calibration(), loader_database()).gather(0)


def _plant() -> None:
    compile_plant(Choice(scenario=SCENARIO).load())


def _plant_with_effects() -> None:
    compile_plant(Choice(scenario=SCENARIO, changes=(f"machine.effects.{EFFECT}={{}}",)).load())


@dataclass(frozen=True, slots=True)
class Part:
    """Something that a process of its own compiles."""

    name: str
    compile: Callable[[], None]
    rarely: bool = False  # a run does not need it


# the longest first, so that the processors end at the same time
PARTS: Final = (
    Part("ECU", _ecu),
    Part("plant", _plant),
    Part("plant with effects", _plant_with_effects, rarely=True),
    Part("test of sensors", _test_of_sensors),
    Part("ECU in C", _ecu_in_c),
    Part("estimates of whole recordings", _tables, rarely=True),
    Part("printed equations", _printed, rarely=True),
)


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
