"""Minutes of random faults in real time: plant, gateway and ECU as processes.

The faults are those of the soak in lockstep, but for the death of the plant, with which a run ends. A new ECU
takes seconds to start: after a kill it is given that time. What is noticed between faults counts against
the bench only if the host gave its processes their time, and only then the bench judges deadlines. A message that
was missed because a single wait for a processor put it off is explained by that wait.
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
from hil.faults import chance, overheard
from hil.faults.passage import Fault
from hil.faults.record import Injected, read_faults
from hil.faults.soak import AFTERWARDS_S, FIRST_S, Happened, Keeper, Soak, plan
from hil.faults.table import SECOND, faults_of
from hil.faults.watch import Notice
from hil.gateway.buses import Buses
from hil.judgement import timing_of, waits_of_senders
from hil.realtime import run_realtime
from hil.rundir import RunDirectory
from hil.supervisor import Event
from hil.timing import starvation, starved_moment
from plant.scenario import load_scenario

NAME = "soak"
RESTARTED_S = 8.0
"""A new ECU process has to import, compile and hear everything."""


def soak_realtime(
    seconds: float, seed: int, folder: Path, progress: Callable[[float], None] = lambda done_s: None
) -> Soak:
    """Run so many seconds and judge what is left in `folder`: the scenario and the run's directory."""
    folder.mkdir(parents=True, exist_ok=True)
    scenario, run = folder / f"{NAME}.toml", folder / "run"
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
        (found.violations if died else found.unexplained).add(f"the run did not end well: {result.reason}")
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
    for table in plan(generator, seconds, afterwards_s, permitted):
        lines += ["", "[[fault]]", *(f"{key} = {json.dumps(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def permitted(table: Mapping[str, object]) -> bool:
    """Whether a run goes on after such a fault."""
    return table.get("process") != "plant"


def afterwards_s(kind: str) -> float:
    """How long after its end a fault of this kind may be noticed."""
    return RESTARTED_S if kind == "kill" else AFTERWARDS_S


def judge(found: Soak, run: Path, faults: Sequence[Fault], stale_s: float) -> None:
    """Fill in what the run directory shows."""
    plant_bus, ecu_bus = overheard.read_bus(run, rundir.BUS), overheard.read_bus(run, rundir.ECU_BUS)
    samples_ns = plant_bus.time_ns[plant_bus.can_id == loader_database().by_name["Articulation"].can_id]
    if not samples_ns.size:
        found.violations.add("the machine never sent a sample")
        return
    zero_ns = int(samples_ns[0])
    Keeper(found).check(overheard.answers_of(ecu_bus))
    notices = [
        *overheard.of_ecu(run),
        *overheard.of_machine(plant_bus, round(stale_s * SECOND)),
        *overheard.of_bench(plant_bus),
        *overheard.of_bench(ecu_bus),
    ]
    left = RunDirectory.read(run)
    waits = waits_of_senders(left)
    timing = timing_of(left)
    found.doubt = starvation(timing) or starved_moment(timing)
    untimely = [] if found.doubt else [*overheard.untimely(plant_bus), *overheard.untimely(ecu_bus)]
    was = {fault.number: fault for fault in read_faults(run)}
    stale_ns = round(stale_s * SECOND)
    attribute(
        found, notices, zero_ns, was, faults, untimely, lambda n: overheard.by_a_wait(n, waits, stale_ns)
    )


def attribute(
    found: Soak,
    notices: Sequence[Notice],
    zero_ns: int,
    was: Mapping[int, Injected],
    faults: Sequence[Fault],
    untimely: Sequence[Notice] = (),
    waited: Callable[[Notice], bool] = lambda notice: False,
) -> None:
    """Each notice to the fault in whose time it falls and whose messages it is about.

    Unexplained are those in no fault's time: what a starved host adds during one cannot be told apart. untimely: of
    the bench's deadlines, which a host may miss by itself now and then, and so only count during a fault. waited: whether
    one wait for a processor explains a notice.
    """
    late_s = np.array([(notice.at_ns - zero_ns) / SECOND for notice in untimely])
    at_s = np.array([(notice.at_ns - zero_ns) / SECOND for notice in notices])
    explained = (at_s < FIRST_S) | (at_s > found.simulated_s)
    for number, fault in enumerate(faults, start=1):
        if number not in was:
            continue
        injected = was[number]
        until_s = (injected.ended_s or found.simulated_s) + afterwards_s(fault.kind)
        within = (at_s >= injected.began_s) & (at_s <= until_s)
        explained |= within
        late = (late_s >= injected.began_s) & (late_s <= until_s)
        told = [notices[i] for i in np.flatnonzero(within).tolist()]
        told += [untimely[i] for i in np.flatnonzero(late).tolist()]
        mine = [notice for notice in told if overheard.concerns(notice, fault)]
        by = frozenset((notice.who, notice.mechanism) for notice in mine)
        found.faults.append(
            Happened(fault=fault, struck=injected.struck > 0 or fault.kind == "kill", noticed=by)
        )
    for notice, time_s, known in zip(notices, at_s.tolist(), explained.tolist(), strict=True):
        if not known and not waited(notice):
            found.unexplained.add(f"{time_s:.2f} s: {notice.who}, {notice.mechanism}: {notice.what}")
