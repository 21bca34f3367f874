"""Random faults in real time, for minutes: plant, gateway and ECU as processes.

The faults are those of the soak in lockstep, except for killing the plant, which ends a run. A new ECU needs seconds to start; after a kill
it gets that time. Detections between faults, and deadlines, count only if the host gave its processes enough processor time. A message that
a single wait for a processor delayed is explained by that wait.
"""

import json
import random
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from dbc import loader_database
from hil import rundir
from hil.compose import Choice
from hil.ending import Ending
from hil.faults.passage import Fault
from hil.faults.record import Injected, read_faults
from hil.faults.table import SECOND, faults_of
from hil.gateway.buses import Buses
from hil.judgement import timing_of, waits_of_senders
from hil.processes.realtime import run_realtime
from hil.processes.supervisor import Event
from hil.rundir import RunDirectory
from hil.timing.measured import starvation, starved_moment
from plant.unit.scenario import load_scenario
from studies.soak import chance
from studies.soak import detections as evidence
from studies.soak.soak import AFTERWARDS_S, FIRST_S, Happened, Keeper, Soak, plan
from studies.soak.watch import Detection

NAME = "soak"
RESTARTED_S = 8.0
"""A new ECU process has to import and compile its code and to receive every message."""


def soak_realtime(
    seconds: float, seed: int, folder: Path, progress: Callable[[float], None] = lambda done_s: None
) -> Soak:
    """Run for `seconds` and judge the run; scenario and run directory stay in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    scenario, run = folder / f"{NAME}.toml", folder / "run"
    # as a file: processes read scenarios, and a run that failed can be repeated by hand
    scenario.write_text(written(random.Random(f"{seed}/real time"), seconds, seed), encoding="utf-8")

    def on_event(_: str, event: Event) -> None:
        if event["event"] == "progress":
            progress(event["time_s"])

    result = run_realtime(Choice(scenario=str(scenario)), run, on_event, Buses(gateway=True))
    found = Soak(seed, simulated_s=result.record.duration_s, episodes=1)
    found.lives = result.record.vitals.lives if result.record.vitals else ()
    if result.ending is not Ending.PASSED:
        died = result.ending in (
            Ending.PEER_DIED,
            Ending.HUB_LOST,
        )  # else it took too long, as on a starved host
        (found.violations if died else found.unexplained).add(f"the run ended early: {result.reason}")
    judge(
        found,
        run,
        faults_of(scenario, loader_database()),
        load_scenario(scenario).equipment.obedience.stale_after,
    )
    return found


def written(generator: random.Random, seconds: float, seed: int) -> str:
    """A scenario with a random drive and random faults, as TOML."""
    lines = [
        f'name = "{NAME}"',
        'sentence = "A random drive under random faults."',
        f"duration_s = {seconds!r}",
        'machine = "l60"',
        f"payload_kg = {generator.uniform(0.0, 3000.0)!r}",
        f"seed = {seed}",
    ]
    for key, table in chance.driver(generator, seconds).items():
        lines += ["", f"[driver.{key}]", f"points = {json.dumps(table['points'])}"]
    # the plan of the lockstep soak: both put the same load on the ECU
    for table in plan(generator, seconds, afterwards_s, permitted):
        lines += ["", "[[fault]]", *(f"{key} = {json.dumps(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def permitted(table: Mapping[str, object]) -> bool:
    """Whether a run goes on after such a fault."""
    return table.get("process") != "plant"


def afterwards_s(kind: str) -> float:
    """How long after its end a fault of this kind may be detected."""
    return RESTARTED_S if kind == "kill" else AFTERWARDS_S


def judge(found: Soak, run: Path, faults: Sequence[Fault], stale_s: float) -> None:
    """Add the violations and detections in the run directory to `found`."""
    plant_bus, ecu_bus = evidence.read_bus(run, rundir.BUS), evidence.read_bus(run, rundir.ECU_BUS)
    samples_ns = plant_bus.time_ns[plant_bus.can_id == loader_database().by_name["Articulation"].can_id]
    # without a sample there is no time zero, and nothing below could be placed
    if not samples_ns.size:
        found.violations.add("the machine sent no sample")
        return
    # both logs have the clock of the host; the scenario's time begins with the machine's first sample
    zero_ns = int(samples_ns[0])
    Keeper(found).check(evidence.answers_of(ecu_bus))
    detections = [
        *evidence.of_ecu(run),
        *evidence.of_machine(plant_bus, round(stale_s * SECOND)),
        *evidence.of_bench(plant_bus),
        *evidence.of_bench(ecu_bus),
    ]
    left = RunDirectory.read(run)
    waits = waits_of_senders(left)
    timing = timing_of(left)
    found.doubt = starvation(timing) or starved_moment(timing)
    # a host without processor time makes every message late: then deadlines say nothing about ECU and machine
    untimely = [] if found.doubt else [*evidence.untimely(plant_bus), *evidence.untimely(ecu_bus)]
    was = {fault.number: fault for fault in read_faults(run)}
    stale_ns = round(stale_s * SECOND)
    attribute(
        found, detections, zero_ns, was, faults, untimely, lambda n: evidence.by_a_wait(n, waits, stale_ns)
    )


def attribute(
    found: Soak,
    detections: Sequence[Detection],
    zero_ns: int,
    was: Mapping[int, Injected],
    faults: Sequence[Fault],
    untimely: Sequence[Detection] = (),
    waited: Callable[[Detection], bool] = lambda detection: False,
) -> None:
    """Assign each detection to the fault during which it was made and whose messages it concerns.

    untimely: violations of deadlines; waited: whether a single wait for a processor explains a detection.
    """
    # Detections outside of all faults are unexplained. During a fault, detections that a busy host causes cannot be distinguished from
    # those of the fault. A host misses a deadline now and then, so `untimely` counts only during a fault.
    late_s = np.array([(detection.at_ns - zero_ns) / SECOND for detection in untimely])
    at_s = np.array([(detection.at_ns - zero_ns) / SECOND for detection in detections])
    explained = (at_s < FIRST_S) | (at_s > found.simulated_s)
    for number, fault in enumerate(faults, start=1):
        if number not in was:
            continue  # its time had not come when the run ended
        injected = was[number]
        until_s = (injected.ended_s or found.simulated_s) + afterwards_s(fault.kind)
        within = (at_s >= injected.began_s) & (at_s <= until_s)
        explained |= within
        late = (late_s >= injected.began_s) & (late_s <= until_s)
        within_its_time = [detections[i] for i in np.flatnonzero(within).tolist()]
        within_its_time += [untimely[i] for i in np.flatnonzero(late).tolist()]
        mine = [detection for detection in within_its_time if evidence.concerns(detection, fault)]
        by = frozenset((detection.who, detection.mechanism) for detection in mine)
        found.faults.append(
            # a kill strikes a process and no frame
            Happened(fault=fault, struck=injected.struck > 0 or fault.kind == "kill", detected=by)
        )
    for detection, time_s, known in zip(detections, at_s.tolist(), explained.tolist(), strict=True):
        if not known and not waited(detection):
            found.unexplained.add(f"{time_s:.2f} s: {detection.who}, {detection.mechanism}: {detection.what}")
