"""Speed of lockstep against real time, and the time of each of its parts.

    python -m bench.bench_lockstep [SCENARIO]

Real time is the peer: the same run paced by the clock takes its simulated duration. Given by the clock on the
wall, and by processor time, which is what the run takes on a machine that has nothing else to do. The parts are
measured around the calls of one run: plant (dynamics, sensors, frames), its reference frames, ECU (receive and
tick), the rest (wire, recording). With the ECU in C frames are rows until they are recorded, and its cycle is one call.
"""

import platform
import statistics
import sys
import time
from importlib.metadata import version

from deploy.c.core import C
from ecu.core import PYTHON
from hil.compose import Choice, plant_unit
from hil.ecu_side import ecu_cycle
from hil.lockstep import Lockstep

REPEATS = 7


class Timed:
    """Passes calls on and adds up their processor time by name."""

    def __init__(self, inner, **parts):
        self._inner = inner
        self._parts = parts
        self.spent = dict.fromkeys(parts.values(), 0.0)

    # by name, so that plant and ECU need not know of it
    def __getattr__(self, name):
        found = getattr(self._inner, name)
        if name not in self._parts:
            return found

        def timed(*arguments):
            start = time.thread_time()
            try:
                return found(*arguments)
            finally:
                self.spent[self._parts[name]] += time.thread_time() - start

        return timed


def sides(scenario, core=PYTHON):
    """A fresh plant and a fresh ECU."""
    return plant_unit(scenario), ecu_cycle(form="corrected", limits=True, core=core)


def whole_run(scenario):
    """x real time by the wall clock and by processor time."""
    bench = Lockstep(*sides(scenario))
    wall, processor = time.perf_counter(), time.thread_time()
    # a row of truth per tick of 10 ms
    simulated = len(bench.run().truth) * 0.01
    return simulated / (time.perf_counter() - wall), simulated / (time.thread_time() - processor)


def parts(scenario, core=PYTHON):
    """Microseconds of processor time per tick and part."""
    plant, ecu = sides(scenario, core)
    if core is C:
        # named by what is called, so that `isinstance` sees what each side offers
        plant = Timed(
            plant, tick_rows="plant: tick", receive="plant: receive", reference_rows="reference frames"
        )
        ecu = Timed(ecu, cycle_rows="ECU")
    else:
        plant = Timed(plant, tick="plant", receive="plant", reference_of="reference frames")
        ecu = Timed(ecu, tick="ECU: tick", receive="ECU: receive")
    start = time.thread_time()
    ticks = len(Lockstep(plant, ecu).run().truth)
    total = time.thread_time() - start
    spent = plant.spent | ecu.spent
    # the difference: timing these calls as well would add the clock's own cost to each
    spent["wire and recording"] = total - sum(spent.values())
    return {name: seconds / ticks * 1e6 for name, seconds in spent.items()}


def row(name, values, digits):
    print(
        f"| {name} | {statistics.median(values):.{digits}f} | {min(values):.{digits}f}..{max(values):.{digits}f} |"
    )


def main() -> int:
    scenario = Choice(scenario=sys.argv[1] if len(sys.argv) > 1 else "loaded").load()
    print(
        f"{platform.machine()}, Python {platform.python_version()}, numba {version('numba')}, {scenario.name}, n={REPEATS}"
    )
    for core in (PYTHON, C):  # compile
        Lockstep(*sides(scenario, core)).step()
    runs = [(whole_run(scenario), parts(scenario), parts(scenario, C)) for _ in range(REPEATS)]
    print("\n| x real time | median | min..max |\n|---|---:|---:|")
    row("by the wall clock", [wall for (wall, _), _, _ in runs], 1)
    row("by processor time", [processor for (_, processor), _, _ in runs], 1)
    for which, heading in ((1, "us per tick of 10 ms"), (2, "us per tick of 10 ms, ECU in C")):
        print(f"\n| {heading} | median | min..max |\n|---|---:|---:|")
        for name in runs[0][which]:
            row(name, [run[which][name] for run in runs], 0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
