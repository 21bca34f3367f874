"""Machines side by side in the lanes of vectors against the same machines one after the other, on one processor.

    python -m bench.bench_lanes [--seconds 2] [--repeats 9]

Processor time of one step of one machine. The first tables are for eight machines, then for other numbers of them; a vector has four lanes. Machines
differ in payload and speed. Medians over the repeats, interleaved so that a busy computer hits all alike.
"""

import argparse
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numba
import numpy as np

from plant.effects.registry import effects
from plant.lanes import ensemble
from plant.lanes.ensemble import Ensemble
from plant.plant import Commands, Plant
from plant.sheets.machine import Machine, load_machine

COMMANDS = Commands(wheel_torque=(500.0,) * 4)
MACHINES = 8
NUMBERS = (1, 2, 4, 16, 32)
EFFECT = "rolling_resistance"


def alike(machine: Machine, count: int) -> list[Plant]:
    """So many plants of a machine."""
    return [Plant(machine, payload_mass=100.0 * i, speed=2.5 + 0.05 * i) for i in range(count)]


def one_by_one(plants: list[Plant], seconds: float) -> Callable[[], None]:
    """The plants from where they are, one after the other."""

    def run() -> None:
        for plant in plants:
            plant.copy().advance(COMMANDS, seconds)

    return run


def together(plants: list[Plant], seconds: float) -> Callable[[], None]:
    """The same side by side."""

    def run() -> None:
        Ensemble(plants).advance(COMMANDS.vector(), seconds)

    return run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=2.0, help="simulated by each repeat")
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    ensemble.CORES = 1  # a share for each processor would be timed together
    plain = load_machine("l60")
    affected = replace(plain, effects=(effects()[EFFECT].typical(),))
    works: dict[str, tuple[int, Callable[[], None]]] = {}
    for label, machine in (("no effects", plain), (f"an effect, {EFFECT}", affected)):
        plants = alike(machine, MACHINES)
        works[f"{MACHINES} machines one by one, {label}"] = MACHINES, one_by_one(plants, options.seconds)
        works[f"{MACHINES} machines side by side, {label}"] = MACHINES, together(plants, options.seconds)
    for count in NUMBERS:
        label = f"{count} machine{'s' if count > 1 else ''} side by side, no effects"
        works[label] = count, together(alike(plain, count), options.seconds)
    for _, run in works.values():
        run()  # compiles
    spent: dict[str, list[float]] = {label: [] for label in works}
    for _ in range(options.repeats):
        for label, (count, run) in works.items():
            start = time.process_time()
            run()
            spent[label].append((time.process_time() - start) / count / (options.seconds / 1e-3) * 1e6)
    print(
        f"{platform.machine()}, Python {platform.python_version()}, numba {numba.__version__}; n={options.repeats}\n"
    )
    print("| us per step and machine, one processor | median | min..max |\n|---|---:|---:|")
    for label, times in spent.items():
        print(f"| {label} | {statistics.median(times):.3f} | {min(times):.3f}..{max(times):.3f} |")
    for label in ("no effects", f"an effect, {EFFECT}"):
        one, other = (spent[f"{MACHINES} machines {way}, {label}"] for way in ("one by one", "side by side"))
        ratios = [a / b for a, b in zip(one, other, strict=True)]
        print(
            f"side by side, {label}: {np.median(ratios):.2f}x one by one ({min(ratios):.2f} to {max(ratios):.2f})"
        )


if __name__ == "__main__":
    main()
