"""The plant process of a real-time run: the machine of one scenario on the bus."""

import logging
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

from dbc import loader_database
from dbc.recordings.writer import CandumpWriter
from hil import rundir
from hil.compose import Choice, plant_unit
from hil.ending import Ending
from hil.foreign.duplicates import OwnIdentifiers, other_sender
from hil.gateway.latency import keep_ticks
from hil.gateway.tap import tapped
from hil.shell.lifeline import Lifeline
from hil.shell.process import counters, log_to, reach, run_until_signal
from hil.shell.realtime_options import ORDINARY, RealtimeOptions
from hil.timing.host import OwnWaits, Sleeps
from plant import node
from plant.unit.reception import Finding
from plant.unit.scenario import Scenario
from plant.unit.unit import TICK_NS, PlantUnit

log = logging.getLogger(__name__)
REFERENCE_CHANNEL = "reference"
PROGRESS_TICKS = 20
WARM_TICKS = 5
NODE = "Machine"


def run(
    line: Lifeline, choice: Choice, address: str, out: Path | None, realtime: RealtimeOptions = ORDINARY
) -> Ending:
    """The machine of one scenario on the bus; with `out`, its truth and timing are left there."""
    log_to(out and out / rundir.PLANT_LOG)
    scenario = choice.load()
    reach(address)
    unit = plant_unit(scenario, choice.fmu)
    # before `ready`: numba compiles for up to a minute, and the run must not begin meanwhile
    compile_plant(scenario)
    realtime.apply()
    line.ready()
    line.wait_for_go()
    kinds: Counter[str] = Counter()
    with ExitStack() as stack:
        stamps = out and rundir.stamps(out, "plant")
        sleeps = Sleeps()
        waits = stack.enter_context(OwnWaits(line.waited, sleeps))
        if out and not line.supervised:
            stack.callback(keep_ticks, out, "plant")
        tap, timing = stack.enter_context(tapped(address, "plant", stamps, waits))
        bus = OwnIdentifiers(
            tap, NODE, loader_database(), lambda name: other_sender(line, "plant", address, name)
        )
        # written here, not on the bus: the ECU must not see the test instrumentation
        reference = out and stack.enter_context(CandumpWriter(out / rundir.REFERENCE))

        def on_tick(ticked: PlantUnit) -> None:
            if reference:
                for frame in ticked.reference_frames():
                    reference.write(frame, REFERENCE_CHANNEL)
            # five times a second is enough for a progress bar
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
                ),
                sleeps,
            )
        finally:
            line.finished(
                complete=unit.finished,
                duration_s=unit.truth.time_s,
                missed=timing.missed,
                **kinds,
                **counters(bus),
                **bus.figures(),
            )
    return Ending.INTERRUPTED if interrupted else Ending.PASSED


def compile_plant(scenario: Scenario) -> None:
    """Compile everything on a plant of its own, so that the first real tick is like every other."""
    unit = plant_unit(scenario)
    for number in range(WARM_TICKS):
        unit.tick(number * TICK_NS)
        unit.reference_frames()
