"""From the command to the result of three examples, ours beside CruciHiL's: `python -m bench.testbench_start --crucihil BIN`.

The examples are those of `crucihil scaffold --example NAME`, rebuilt in examples/engine. Both commands start anew every time, in turns, and
the first turn, which fills caches, does not count. Install CruciHiL into an environment of its own: `pip install 'crucihil==0.16.*'`.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from bench.speed import machine

ROOT = Path(__file__).parents[1]
EXAMPLES = {
    "hello_world": ("hello", "test_hello.py"),
    "can_signals": ("can_signals", "test_signals.py"),
    "fault_injection": ("fault_injection", "test_faults.py"),
}
"""Of each example of theirs: its suite, and our file."""


def timed(command: Sequence[str], folder: Path) -> float:
    """Seconds until the command has ended; CalledProcessError with its output where it fails."""
    # as a user's machine has them: compiled modules are kept
    settings = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    started = time.perf_counter()
    done = subprocess.run(command, cwd=folder, env=settings, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - started
    if done.returncode:
        raise SystemExit(
            f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
        )
    return seconds


def main() -> None:
    """Print one row per example."""
    parser = argparse.ArgumentParser(prog="python -m bench.testbench_start", description=__doc__)
    parser.add_argument("--crucihil", type=Path, required=True, help="the command `crucihil`")
    parser.add_argument("--turns", type=int, default=7)
    args = parser.parse_args()
    peer = str(args.crucihil.resolve())
    print(f"{machine()}; {args.turns} turns; load {os.getloadavg()[0]:.1f}\n")
    print("| example | theirs | ours | ours over theirs |\n|---|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as folder:
        for name, (suite, file) in EXAMPLES.items():
            subprocess.run([peer, "scaffold", "--example", name], cwd=folder, check=True, capture_output=True)
            theirs, ours = [], []
            for turn in range(args.turns + 1):
                pair = (
                    timed(
                        [peer, "run", "--suite", f"suites/{suite}.yaml", "--rig", "rigs/virtual.toml"],
                        Path(folder) / "examples" / name,
                    ),
                    timed([sys.executable, "-m", "pytest", "-q", f"examples/engine/{file}"], ROOT),
                )
                if turn:
                    theirs.append(pair[0])
                    ours.append(pair[1])
            cells = (f"{median(t):.2f} s ({min(t):.2f} to {max(t):.2f})" for t in (theirs, ours))
            print(f"| `{name}` | {' | '.join(cells)} | {median(ours) / median(theirs):.1f} |", flush=True)


if __name__ == "__main__":
    main()
