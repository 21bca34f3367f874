"""Physical floors of this machine: figures that no program in Python on one of its processors can beat. For bench.speed.

python -m bench.floors
"""

import os
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np

# Odd, so that the median is a measured value.
REPEATS = 9
COPIED = 1 << 26  # bytes: beyond every cache of a desktop processor
CALLS = 200_000


def _spread(measure: Callable[[], float]) -> tuple[float, float, float]:
    """Median, least and most of some repeats, after one that does not count."""
    # fills caches and page tables
    measure()
    values = [measure() for _ in range(REPEATS)]
    return statistics.median(values), min(values), max(values)


def _bandwidth() -> float:
    """Bytes read and written per second by one processor that copies memory."""
    # np.ones and not zeros: pages of zeros are not there until they are written
    source, target = np.ones(COPIED // 8), np.empty(COPIED // 8)
    start = time.perf_counter()
    np.copyto(target, source)
    # each byte is read once and written once
    return 2.0 * COPIED / (time.perf_counter() - start)


def _system_call() -> float:
    """Seconds of one system call that does next to nothing, called from Python: a read of one byte from /dev/zero."""
    zero = os.open("/dev/zero", os.O_RDONLY)
    try:
        start = time.perf_counter()
        for _ in range(CALLS):
            os.read(zero, 1)
        return (time.perf_counter() - start) / CALLS
    finally:
        os.close(zero)


def _nothing() -> None:
    """A function without a body."""


def _call() -> float:
    """Seconds of one call of a Python function that does nothing, its loop included."""
    start = time.perf_counter()
    for _ in range(CALLS):
        _nothing()
    return (time.perf_counter() - start) / CALLS


FLOORS: dict[str, tuple[Callable[[], float], float, str]] = {
    "memory bandwidth": (_bandwidth, 1e-9, "GB/s"),
    "system call": (_system_call, 1e6, "us"),
    "function call": (_call, 1e6, "us"),
}
"""By name: what measures it, the factor to the printed unit, and that unit."""


def main() -> int:
    print("| floor | median | min..max |\n|---|---:|---:|")
    for name, (measure, factor, unit) in FLOORS.items():
        middle, least, most = (value * factor for value in _spread(measure))
        print(f"| {name} [{unit}] | {middle:.4g} | {least:.4g}..{most:.4g} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
