"""The ECU's cycle on a realistic frame stream, and its estimators over columns against a plain loop over rows.

    python -m bench.bench_ecu

The stream is the machine's own frames of the drive case `loaded`, made before the clock starts. A cycle is
everything the process does between two waits but the system calls: receive the tick's frames, tick, make the answers.
"""

import gc
import platform
import statistics
import sys
import time
from importlib.metadata import version

import numpy as np

from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle
from ecu.estimators.columns import BLOCK, estimate_columns
from ecu.estimators.estimate import corrected
from ecu.estimators.signals import Inputs
from ecu.estimators.state import INITIAL
from hil.compose import Choice, plant_unit
from studies.campaigns.ablation import inputs_of

TICKS = 1500
# Two seconds: the ECU is in RUNNING, filters have settled, every branch has been taken once.
WARM = 200
ROWS = 200_000
# Called from Python a row costs more: fewer rows give the same precision.
PLAIN_ROWS = 5_000
REPEATS = 5
PERIOD_NS = 10_000_000


def stream():
    """The machine's frames, tick by tick."""
    unit = plant_unit(Choice(scenario="loaded").load())
    return [unit.tick(k * PERIOD_NS) for k in range(TICKS)]


def cycles(frames, *, collecting=True):
    """Time of every cycle after the warm-up [us], shape (n, 2): by the clock, and of the processor for this thread."""
    ecu = EcuCycle(load_calibration())
    ecu.warm_up()
    gc.collect()
    # as the process does: objects of the start are never looked at again by the collector
    gc.freeze()
    if not collecting:
        gc.disable()
    times = []
    for k, sent in enumerate(frames):
        now = k * PERIOD_NS
        start, worked = time.perf_counter_ns(), time.thread_time_ns()
        for frame in sent:
            ecu.receive(frame, now)
        # half a period after the frames, as in lockstep: their age is then that of real traffic
        ecu.tick(now + PERIOD_NS // 2)
        # both clocks: the wall shows what a deadline sees, the thread's what the code costs
        times.append((time.perf_counter_ns() - start, time.thread_time_ns() - worked))
    gc.enable()
    gc.unfreeze()
    return np.array(times[WARM:]) * 1e-3


def inputs(frames):
    """The estimators' inputs of every cycle after the warm-up."""
    stamped = [f._replace(at_ns=k * PERIOD_NS) for k, sent in enumerate(frames) for f in sent]
    return inputs_of(stamped, load_calibration())[1][WARM:]


def spread(values):
    """Median, least and most."""
    return f"{statistics.median(values):.0f} ({min(values):.0f} to {max(values):.0f})"


def main() -> int:
    print(
        f"{platform.machine()}, Python {platform.python_version()}, numba {version('numba')}, loaded, n={TICKS - WARM}"
    )
    frames = stream()
    print("\n| cycle | p50 [us] | p99 [us] | longest [us] |\n|---|--:|--:|--:|")
    for name, collecting in (("collector on", True), ("collector off", False)):
        runs = np.array([cycles(frames, collecting=collecting) for _ in range(REPEATS)])
        for kind, found in (("clock", runs[:, :, 0]), ("processor", runs[:, :, 1])):
            # percentiles within a run, then their spread over runs: pooled, one slow run would hide in the tail
            cells = [spread(np.percentile(found, q, axis=1)) for q in (50, 99, 100)]
            print(f"| {name}, {kind} | {' | '.join(cells)} |")
    print()

    parameters = load_calibration().parameters
    some = inputs(frames)
    # the drive repeated: estimators with states see real transitions, not constants
    rows = np.tile(some, (ROWS // len(some) + 1, 1))[:ROWS]
    # as many rows as need the code of large tables, so that no repeat compiles or loads it
    for prediction in (True, False):
        estimate_columns(rows[: 2 * BLOCK], parameters, prediction=prediction)
    columns, now, plain = [], [], []
    for _ in range(REPEATS):
        start = time.perf_counter()
        estimate_columns(rows, parameters)
        columns.append(ROWS / (time.perf_counter() - start) * 1e-6)
        start = time.perf_counter()
        estimate_columns(rows, parameters, prediction=False)
        now.append(ROWS / (time.perf_counter() - start) * 1e-6)
        start, state = time.perf_counter(), INITIAL
        for row in rows[:PLAIN_ROWS]:
            _, state = corrected(Inputs(*row.tolist()), state, parameters)
        plain.append(PLAIN_ROWS / (time.perf_counter() - start) * 1e-6)
    for name, rate in (
        ("columns", columns),
        ("columns without the prediction", now),
        ("the compiled step, row by row from Python", plain),
    ):
        print(
            f"{statistics.median(rate):7.3f} million samples/s ({min(rate):.3f} to {max(rate):.3f})  {name}"
        )
    print(f"columns: {statistics.median(columns) / statistics.median(plain):.1f}x")
    return 0


if __name__ == "__main__":
    sys.exit(main())
