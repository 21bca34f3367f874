"""Cost of effects: a step of the plain plant, and of the same plant with effects switched on, in one run.

    python -m bench.bench_effects [--seconds 5] [--repeats 9]

An effect that only changes parameters must cost nothing: the compiled code is the plain plant's. The first row is
therefore measured twice: the spread of that ratio is the resolution of the other rows. One row per hook that an effect may have.
"""

import argparse
import statistics
import time
from dataclasses import replace

from plant.effects import effects
from plant.effects.dispatch import compiled_hooks
from plant.effects.registry import python_hook
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine

COMMANDS = Commands(wheel_torque=(500.0,) * 4)
# Effects that leave the motion nearly as it is: contact and slip, and so the cost of a step, stay comparable.
CALM = (
    "camber_thrust",
    "brake_drag",
    "pivot_friction",
    "lateral_deflection",
    "rolling_resistance",
    "turn_slip",
)
# One for each hook; of several that have it, one that leaves the motion calm.
ONE = (
    "pivot_friction",
    "washboard",
    "rolling_resistance",
    "aerodynamic_drag",
    "frame_torsion",
    "steering_friction",
)


def variants():
    """Row of the table -> machine with those effects."""
    base, known = load_machine("l60"), effects()
    prepared = [
        item
        for item in known.values()
        # these only change parameters: no code of theirs runs in a step
        if python_hook(item, "prepare") is not None and not compiled_hooks(item)
    ]

    def having(*names):
        return replace(base, effects=tuple(known[name].typical() for name in names))

    return {
        "plain": base,
        "plain, again": base,
        "effects of parameters": having(
            *(item.name for item in prepared if item.name in ("tyre_wear", "mass_split"))
        ),
        **{
            f"one compiled effect, {name}: {', '.join(compiled_hooks(known[name]))}": having(name)
            for name in ONE
        },
        f"{len(CALM)} compiled effects": having(*CALM),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=5.0, help="simulated by each repeat")
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    plants = {name: Plant(machine, speed=3.0) for name, machine in variants().items()}
    spent = {name: [] for name in plants}
    for plant in plants.values():
        plant.advance(COMMANDS, 0.01)  # compiles
    for _ in range(options.repeats):
        for name, plant in plants.items():
            # every repeat starts from the same state: contact and slip change the cost of a step
            fresh = plant.copy()
            start = time.process_time()
            fresh.advance(COMMANDS, options.seconds)
            spent[name].append((time.process_time() - start) / (options.seconds / plant.step_s) * 1e6)
    print(
        "| switched on | us per step | range | x plain, median of pairs | range |\n| --- | ---: | ---: | ---: | ---: |"
    )
    for name, times in spent.items():
        # pairs of one round: both ran under the same load of the computer
        ratio = [a / b for a, b in zip(times, spent["plain"], strict=True)]
        print(
            f"| {name} | {statistics.median(times):.2f} | {min(times):.2f}..{max(times):.2f} "
            f"| {statistics.median(ratio):.2f} | {min(ratio):.2f}..{max(ratio):.2f} |"
        )


if __name__ == "__main__":
    main()
