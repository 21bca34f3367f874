"""Lockstep against real time, and where its time goes.

    python bench/bench_lockstep.py [SCENARIO]

Real time is the peer: the same run paced by the clock takes its simulated duration. The parts are measured
around the calls of one run: plant (dynamics, sensors, frames), ECU (receive and tick), the rest (wire, recording).
"""

import platform
import statistics
import sys
import time
from importlib.metadata import version

from hil.compose import Choice, plant_unit
from hil.ecu_side import ecu_cycle
from hil.lockstep import Lockstep

REPEATS = 5


class Timed:
    """Passes calls on and adds up their time."""

    def __init__(self, inner):
        self._inner = inner
        self.spent = 0.0

    def _timed(self, work, *arguments):
        start = time.perf_counter()
        try:
            return work(*arguments)
        finally:
            self.spent += time.perf_counter() - start

    def receive(self, frame, now_ns):
        return self._timed(self._inner.receive, frame, now_ns)

    def tick(self, now_ns):
        return self._timed(self._inner.tick, now_ns)

    def reference_frames(self):
        return self._timed(self._inner.reference_frames)

    @property
    def truth(self):
        start = time.perf_counter()
        truth = self._inner.truth
        self.spent += time.perf_counter() - start
        return truth

    @property
    def finished(self):
        return self._inner.finished


def main() -> int:
    scenario = Choice(scenario=sys.argv[1] if len(sys.argv) > 1 else "loaded").load()
    print(
        f"{platform.machine()}, Python {platform.python_version()}, numba {version('numba')}, {scenario.name}, n={REPEATS}"
    )
    Lockstep(plant_unit(scenario), ecu_cycle(form="corrected", limits=True)).step()  # compile
    speeds, parts = [], []
    for timed in [False, True] * REPEATS:
        plant, ecu = plant_unit(scenario), ecu_cycle(form="corrected", limits=True)
        if timed:
            plant, ecu = Timed(plant), Timed(ecu)
        bench = Lockstep(plant, ecu)
        start = time.perf_counter()
        ticks = len(bench.run().truth)
        elapsed = time.perf_counter() - start
        if timed:
            parts.append(
                (
                    plant.spent / ticks * 1e6,
                    ecu.spent / ticks * 1e6,
                    (elapsed - plant.spent - ecu.spent) / ticks * 1e6,
                )
            )
        else:
            speeds.append(ticks * 0.01 / elapsed)
    print(f"{statistics.median(speeds):6.1f} x real time ({min(speeds):.1f} to {max(speeds):.1f})")
    for name, values in zip(("plant", "ECU", "wire and recording"), zip(*parts, strict=True), strict=True):
        print(
            f"{statistics.median(values):6.0f} us per tick ({min(values):.0f} to {max(values):.0f})  {name}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
