"""Cost and result of a diagnosis of the whole loader: `python -m bench.bench_diagnose_loader [--minutes 0.7 10]`.

Random drives through driver, sensors and CAN (bench.loader_truth), with nothing, one and two effects hidden; all effects of the
library are candidates. Processor seconds are given beside the elapsed ones, which a busy machine lengthens; the floor is the same
number of bare simulations.
"""

import argparse
import tempfile
import time
from pathlib import Path

from bench.loader_truth import Arm, record
from discrepancy.decision.judge import judge
from discrepancy.estimation.problem import Problem
from discrepancy.models.loader import model as loader
from discrepancy.selection.state import Settings

# Nothing costs one screen, each effect a search more: the three rows bound the usual cost.
HIDDEN = (
    (),
    ("payload_mass",),
    ("rolling_resistance", "yaw_rate delay"),
)


def measured(arm: Arm) -> str:
    """One row of the table."""
    with tempfile.TemporaryDirectory(prefix="loaderhil-bench-") as folder:
        record(arm, Path(folder) / "run")
        recording = loader.load_run(Path(folder) / "run")
    model = loader.model([recording])
    # made before the clock starts: reading and cutting the recording is no simulation
    problem = Problem(model, [recording])
    started, used = time.perf_counter(), time.process_time()
    found = judge(problem, Settings()).findings
    seconds, processor = time.perf_counter() - started, time.process_time() - used
    values, floor = problem.start(), time.process_time()
    for i in range(5):
        # another mass each time: the last predictions are kept, and a repeated one would cost nothing
        problem.predict(values.having(rear_mass=float(i + 1)))
    floor = (time.process_time() - floor) / 5 * found.simulations
    named = ", ".join(found.named) or found.status
    hidden = ", ".join(arm.effects) or "nothing"
    return (
        f"| {arm.duration_s / 60:.2g} min | {hidden} | {named} | {found.simulations} | {seconds:.0f} s | {processor:.0f} s "
        f"| {processor / floor:.2f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, nargs="+", default=[0.7, 10.0])
    parser.add_argument("--seed", type=int, default=30)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="loaderhil-bench-") as folder:  # compiles
        record(Arm(seed=args.seed, duration_s=3.0), Path(folder) / "run")
    print("| recording | hidden | named | simulations | diagnosis | processors | over bare simulations |")
    print("|---|---|---|---|---|---|---|")
    for minutes in args.minutes:
        for hidden in HIDDEN:
            print(measured(Arm(effects=hidden, seed=args.seed, duration_s=60.0 * minutes)), flush=True)


if __name__ == "__main__":
    main()
