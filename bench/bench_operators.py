"""Operators with memory that nearly every simulation of a diagnosis calls: `python -m bench.bench_operators [--samples 1600] [--repeats 9]`.

A lag behind the three columns of a command, and play. Peers: scipy.signal.lfilter, which needs even stamps (they are even here), and a loop over
samples in Python. Floor: the loop compiled by numba. Differences are from the loop.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numba
import numpy as np
from scipy.signal import lfilter

from discrepancy.estimation.jumps import Command, Commands
from discrepancy.model.operators import play

STEP_S, LAG_S, WIDTH = 0.01, 0.3, 0.7


def lag_by_loop(stamps, values, lag_s):
    """A first-order lag behind held inputs (m, c) at their stamps."""
    found = np.empty_like(values)
    found[0] = values[0]
    for k in range(1, stamps.size):
        left = np.exp(-(stamps[k] - stamps[k - 1]) / lag_s)
        for c in range(values.shape[1]):
            found[k, c] = values[k - 1, c] + left * (found[k - 1, c] - values[k - 1, c])
    return found


def play_by_loop(x, width):
    """The value moves with the edge of its dead zone that reaches it."""
    found = np.empty_like(x)
    now = x[0]
    for k in range(x.size):
        now = min(max(now, x[k] - width), x[k] + width)
        found[k] = now
    return found


def measured(call: Callable[[], np.ndarray], repeats: int) -> tuple[list[float], np.ndarray]:
    """Microseconds of a call, and its result."""
    result = call()  # compiles
    start = time.perf_counter()
    call()
    times = max(int(0.05 / (time.perf_counter() - start)), 1)
    found = []
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(times):
            call()
        found.append(1e6 * (time.perf_counter() - start) / times)
    return found, result


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, default=1600)
    parser.add_argument("--repeats", type=int, default=9)
    args = parser.parse_args()
    rng = np.random.default_rng(1)
    stamps = STEP_S * np.arange(args.samples)
    values = rng.normal(size=(args.samples, 3)).cumsum(axis=0)
    commands = Commands.made(np.zeros((3, 3)), [Command(stamps, values)])
    left = np.exp(-STEP_S / LAG_S)
    compiled_lag, compiled_play = numba.njit(lag_by_loop), numba.njit(play_by_loop)
    x = np.ascontiguousarray(values[:, 0])

    def by_filter() -> np.ndarray:
        return lfilter([0.0, 1.0 - left], [1.0, -left], values, axis=0, zi=values[:1])[0]

    groups = {
        "lag behind a command": {
            "ours": lambda: commands.at(stamps, LAG_S),
            "scipy.signal.lfilter, even stamps": by_filter,
            "a loop in Python": lambda: lag_by_loop(stamps, values, LAG_S),
            "floor: the loop by numba": lambda: compiled_lag(stamps, values, LAG_S),
        },
        "play": {
            "ours": lambda: play(x, WIDTH),
            "a loop in Python": lambda: play_by_loop(x, WIDTH),
            "floor: the loop by numba": lambda: compiled_play(x, WIDTH),
        },
    }
    print("| operator | by | time of a call, us | over ours | difference |")
    print("|---|---|---|---|---|")
    for operator, ways in groups.items():
        ours, reference = 0.0, ways["a loop in Python"]()
        for way, call in ways.items():
            times, result = measured(call, args.repeats)
            median = statistics.median(times)
            ours = ours or median
            spread = f"{median:.1f} ({min(times):.1f} to {max(times):.1f})"
            print(
                f"| {operator} | {way} | {spread} | {median / ours:.2f} | {np.max(np.abs(result - reference)):.1e} |"
            )


if __name__ == "__main__":
    main()
