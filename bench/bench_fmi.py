"""Cost of a model as an FMU over the same equations in Python, and of our plant as an FMU over the plant: `python -m bench.bench_fmi`.

The FMU is the tank of the tests, compiled with gcc; the Python model is that of docs/howto/write-a-model.md.
"""

import argparse
import re
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from discrepancy.examine import examine
from discrepancy.model import Recording, Window, signal
from discrepancy.selection.state import Settings
from fmi.export import export
from fmi.model import read_model
from fmi.motion import motion_of
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from tests.fmi.fmus import TANK, built

ROOT = Path(__file__).resolve().parents[1]
STEPS = 1000  # of one simulation
TICKS = 1000  # of 10 ms of the plant


def page(name: str, language: str) -> str:
    """The first block of a how-to in that language."""
    text = (ROOT / "docs/howto" / name).read_text("utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)[0]


def drive() -> Recording:
    """115 s of the tank with a leak of 0.05 1/s."""
    t = np.arange(0.0, 115.0, 0.1)
    inflow = np.random.default_rng(1).uniform(0.0, 0.2, 40)[(t / 3.0 + 1e-9).astype(int)]
    level = [1.0]
    for u in inflow[:-1]:
        level.append(u / 0.05 + (level[-1] - u / 0.05) * np.exp(-0.005))
    noisy = np.array(level) + np.random.default_rng(2).normal(0.0, 0.01, t.size)
    return Recording(
        "drive", {"inflow": signal(t, inflow, "m^3/s", held=True), "level": signal(t, noisy, "m")}
    )


def seconds(work: Callable[[], object], runs: int) -> str:
    """Median and range of some runs [s]."""
    work()  # compiles, loads
    found = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        found.append(time.perf_counter() - start)
    return f"{np.median(found):.4f} s ({min(found):.4f} to {max(found):.4f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    runs = parser.parse_args().runs
    names: dict[str, object] = {}
    exec(page("write-a-model.md", "python"), names)
    recording, grid = drive(), np.arange(STEPS) * 0.1
    window = Window(
        recording="r",
        start_s=0.0,
        end_s=float(grid[-1]),
        time_s=grid,
        step_s=0.1,
        known={"inflow": np.full(STEPS, 0.1), "level": np.ones(STEPS)},
        constants={},
    )
    print("| work | Python | FMU |")
    print("|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        file = built(TANK, Path(folder))
        file.with_suffix(".toml").write_text(page("use-fmu.md", "toml"), encoding="utf-8")
        python, fmu = names["model"], read_model(file).build([recording])
        rows = [
            seconds(lambda m=m: m.simulate(window, {"area": 1.0, "start_level": 1.0}, {}), runs)
            for m in (python, fmu)
        ]
        print(f"| one simulation of {STEPS} steps | {' | '.join(rows)} |")
        rows = [seconds(lambda m=m: examine(m, [recording], Settings()), runs) for m in (python, fmu)]
        print(f"| diagnosis of {grid.size * 1.15 * 0.1:.0f} s | {' | '.join(rows)} |")
        wheel_loader = Path(folder) / "machine.fmu"
        export("l60", wheel_loader, 2, {})
        plant, motion = Plant(load_machine("l60")), motion_of(wheel_loader)

        def ticks(moving) -> None:
            for _ in range(TICKS):
                moving.advance(Commands(), 0.01)
                moving.truth()

        rows = [seconds(lambda m=m: ticks(m), runs) for m in (plant, motion)]
        print(f"| {TICKS} ticks of the plant | {' | '.join(rows)} |")


if __name__ == "__main__":
    main()
