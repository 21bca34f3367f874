"""The plant process: the machine of one scenario on the bus, in real time."""

import logging
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bus.pacing import TickTiming
from dbc.writer import CandumpWriter
from hil import rundir
from hil.compose import Choice, plant_unit
from hil.ending import Ending
from hil.gateway.tap import tapped
from hil.lifeline import Lifeline
from hil.processes.shell import counters, log_to, reach, run_until_signal
from hil.realtime_options import ORDINARY, RealtimeOptions
from plant import node
from plant.reception import Finding
from plant.scenario import Scenario
from plant.unit import TICK_NS, PlantUnit

log = logging.getLogger(__name__)
REFERENCE_CHANNEL = "reference"
PROGRESS_TICKS = 20
WARM_TICKS = 5


def run(
    line: Lifeline, choice: Choice, address: str, out: Path | None, realtime: RealtimeOptions = ORDINARY
) -> Ending:
    """The machine of one scenario on the bus; with `out`, its truth and timing are left there."""
    log_to(out and out / rundir.PLANT_LOG)
    scenario = choice.load()
    reach(address)
    unit = plant_unit(scenario)
    _warm_plant(scenario)
    realtime.apply()
    line.ready()
    line.wait_for_go()
    started_ns: list[int] = []
    kinds: Counter[str] = Counter()
    with ExitStack() as stack:
        stamps = out and rundir.stamps(out, "plant")
        bus, timing = stack.enter_context(tapped(address, "plant", stamps))
        reference = out and stack.enter_context(CandumpWriter(out / rundir.REFERENCE))

        def on_tick(ticked: PlantUnit, now_ns: int) -> None:
            started_ns.append(now_ns)
            if reference:
                for frame in ticked.reference_frames():
                    reference.write(frame, REFERENCE_CHANNEL)
            if ticked.sequence % PROGRESS_TICKS == 0:
                line.progress(ticked.truth.time_s, scenario.duration_s)

        def on_finding(finding: Finding) -> None:
            kinds[f"finding_{finding.what.name}"] += 1
            log.warning("%s: %s", finding.message, finding.what.name)

        truth_path = out and out / rundir.TRUTH
        try:
            interrupted = run_until_signal(
                node.run(
                    bus, unit, on_tick=on_tick, on_finding=on_finding, timing=timing, truth_path=truth_path
                )
            )
        finally:
            if out:
                rundir.write_table(rundir.part_of_timing(out, "plant"), _columns(timing, started_ns))
            line.finished(
                complete=unit.finished,
                duration_s=unit.truth.time_s,
                missed=timing.missed,
                **kinds,
                **counters(bus),
            )
    return Ending.INTERRUPTED if interrupted else Ending.PASSED


def _columns(timing: TickTiming, started_ns: list[int]) -> dict[str, NDArray[np.int64]]:
    """Of timing.npz; `due_ns` says which stamp of the bus clock each row of the truth belongs to."""
    columns = timing.arrays()
    due_ns = np.array(started_ns, np.int64) - columns["lateness_ns"][: len(started_ns)]
    return {**columns, "due_ns": due_ns}


def _warm_plant(scenario: Scenario) -> None:
    """Compile everything on a plant of its own, so that the first real tick is like every other."""
    unit = plant_unit(scenario)
    for number in range(WARM_TICKS):
        unit.tick(number * TICK_NS)
        unit.reference_frames()
