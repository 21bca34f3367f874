"""Cost of a diagnosis over the floor of its bare simulations: `python -m bench.bench_discrepancy [--minutes 1.6 10]`.

The quality of its results is measured by `make proof`. The drive holds two effects; truth as in bench/proof/straight_truth.py.
"""

import argparse
import time

import numpy as np

from bench.proof.straight_truth import COLOURED, record
from discrepancy.decision.judge import judge
from discrepancy.estimation.problem import Problem
from discrepancy.models.straight import MASS_KG, model
from discrepancy.selection.state import Settings

HIDDEN = {"rolling": 0.01, "speed.delay": 0.05}


def measured(minutes: float, seed: int) -> tuple[float, float, int]:
    """Seconds of the diagnosis, seconds of as many bare simulations, their number."""
    truth = {"mass": MASS_KG, "viscous": 400.0, **HIDDEN}
    recording = record(truth, COLOURED, np.random.default_rng(seed), duration_s=60.0 * minutes)
    start = time.perf_counter()
    found = judge(Problem(model(), [recording]), Settings()).findings
    seconds = time.perf_counter() - start
    # a new problem: the old one holds predictions of its search
    bare = Problem(model(), [recording])
    values = bare.start()
    start = time.perf_counter()
    for _ in range(20):
        bare.predict(values)
    # the floor: what the simulations alone would take; the rest is linear algebra and bookkeeping
    return seconds, (time.perf_counter() - start) / 20 * found.simulations, found.simulations


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, nargs="+", default=[1.6, 10.0])
    parser.add_argument("--runs", type=int, default=3)
    args = parser.parse_args()
    measured(0.5, 0)  # compiles
    print("| recording | simulations | diagnosis | bare simulations | ratio |")
    print("|---|---|---|---|---|")
    for minutes in args.minutes:
        runs = [measured(minutes, seed) for seed in range(1, args.runs + 1)]
        seconds, floor, count = (np.array(column) for column in zip(*runs, strict=True))
        spread = f"{np.median(seconds):.1f} s ({seconds.min():.1f} to {seconds.max():.1f})"
        print(
            f"| {minutes:g} min | {np.median(count):.0f} | {spread} | {np.median(floor):.1f} s | {np.median(seconds / floor):.2f} |"
        )


if __name__ == "__main__":
    main()
