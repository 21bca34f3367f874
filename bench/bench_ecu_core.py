"""Lockstep with the ECU in C against lockstep with the ECU in Python, and what each core costs the processor.

    python -m bench.bench_ecu_core [SCENARIO]

The two runs of a pair follow one another, in turn the one and the other first, so that a computer that slows down slows both; their
ratio is of the pair. Every pair has to leave the same frames, or the benchmark ends with exit code 1. The ECU alone hears the frames of
the machine again, with and without the test of sensors against each other; its peer is cantools, which only decodes them.
"""

import itertools
import platform
import statistics
import sys
import time
from collections.abc import Sequence
from importlib.metadata import version

import cantools

from bus.frame import Frame
from dbc import FOLDER, loader_database
from deploy.c.core import C
from ecu.core import PYTHON, Core, Ecu
from ecu.outputs import TICK_NS
from hil.compose import Choice, plant_unit
from hil.ecu_side import ecu_cycle
from hil.lockstep import Lockstep
from plant.unit.scenario import Scenario

REPEATS = 9


def ecu_of(core: Core, *, detect_faults: bool = False) -> Ecu:
    """A fresh ECU that is ready."""
    ecu = ecu_cycle(form="corrected", limits=True, core=core, detect_faults=detect_faults)
    ecu.warm_up()
    return ecu


def run(scenario: Scenario, core: Core) -> tuple[float, list[Frame]]:
    """Processor time of a whole run [s], and its frames."""
    bench = Lockstep(plant_unit(scenario), ecu_of(core), reference=False)
    start = time.thread_time()
    recording = bench.run()
    seconds = time.thread_time() - start
    return seconds, recording.bus


def heard_of(frames: Sequence[Frame]) -> list[Frame]:
    """The frames that the ECU hears."""
    known = loader_database().by_id
    return [frame for frame in frames if "Machine" in known[frame.can_id].senders]


def decoded(heard: Sequence[Frame], database: cantools.database.can.Database) -> float:
    """Processor time of cantools for the same frames, decoded to plain numbers, per tick [us]."""
    ticks = heard[-1].at_ns // TICK_NS
    start = time.thread_time()
    for frame in heard:
        database.decode_message(frame.can_id, frame.data, decode_choices=False)
    return (time.thread_time() - start) / ticks * 1e6


def cycle(heard: Sequence[Frame], core: Core, *, detect_faults: bool = False) -> float:
    """Processor time of the ECU alone for the frames of a run, per tick [us]: receive and tick."""
    ecu, ticks, now = ecu_of(core, detect_faults=detect_faults), 0, TICK_NS // 2
    start = time.thread_time()
    for frame in heard:
        while frame.at_ns > now:
            ecu.tick(now)
            ticks, now = ticks + 1, now + TICK_NS
        ecu.receive(frame, frame.at_ns)
    return (time.thread_time() - start) / ticks * 1e6


def row(name: str, values: Sequence[float], digits: int) -> None:
    """Median and spread."""
    spread = f"{min(values):.{digits}f}..{max(values):.{digits}f}"
    print(f"| {name} | {statistics.median(values):.{digits}f} | {spread} |")


def main() -> int:
    """Measure and print."""
    scenario = Choice(scenario=sys.argv[1] if len(sys.argv) > 1 else "loaded").load()
    print(
        f"{platform.machine()}, Python {platform.python_version()}, numba {version('numba')}, {scenario.name}, n={REPEATS}"
    )
    for core in (PYTHON, C):  # compile
        Lockstep(plant_unit(scenario), ecu_of(core)).step()
    spent: dict[str, list[float]] = {"python": [], "c": []}
    alone: dict[str, list[float]] = {
        name: [] for name in ("python", "c", "python tested", "c tested", "cantools")
    }
    database = cantools.database.load_file(FOLDER / "loader.dbc")
    assert isinstance(database, cantools.database.can.Database)
    for order in itertools.islice(itertools.cycle(((PYTHON, C), (C, PYTHON))), REPEATS):
        sent = []
        for core in order:
            seconds, frames = run(scenario, core)
            spent[core.name].append(scenario.duration_s / seconds)
            sent.append(frames)
        if sent[0] != sent[1]:
            print("the two cores did not send the same frames", file=sys.stderr)
            return 1
        heard = heard_of(sent[0])
        for core in order:
            alone[core.name].append(cycle(heard, core))
            alone[f"{core.name} tested"].append(cycle(heard, core, detect_faults=True))
        alone["cantools"].append(decoded(heard, database))
    print("\n| x real time, by processor time | median | min..max |\n|---|---:|---:|")
    row("lockstep, Python core", spent["python"], 1)
    row("lockstep, C core", spent["c"], 1)
    row("C over Python", [c / p for c, p in zip(spent["c"], spent["python"], strict=True)], 2)
    print("\n| ECU alone, us per tick of 10 ms | median | min..max |\n|---|---:|---:|")
    row("Python core", alone["python"], 0)
    row("C core", alone["c"], 0)
    row("Python over C", [p / c for c, p in zip(alone["c"], alone["python"], strict=True)], 1)
    for name, core_name in (("Python", "python"), ("C", "c")):
        tested = alone[f"{core_name} tested"]
        row(f"{name} core, sensors tested", tested, 0)
        row(
            f"{name}, tested over not",
            [t / p for t, p in zip(tested, alone[core_name], strict=True)],
            2,
        )
    row("cantools, decoding alone", alone["cantools"], 0)
    over = [t / d for t, d in zip(alone["python tested"], alone["cantools"], strict=True)]
    row("Python, tested over cantools", over, 2)
    return 0


if __name__ == "__main__":
    sys.exit(main())
