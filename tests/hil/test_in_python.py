"""Plant and ECU as Python: for a debugger, and for an edit that is tried before it is compiled."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np


def truth_of_run(folder: Path, **environment: str) -> dict[str, np.ndarray]:
    """The true motion of a machine that rolls with its joint turned, run by the program in a process with these variables set."""
    run = subprocess.run(
        [sys.executable, "-W", "error", "-m", "loaderhil", "run", "hard_braking", "--set", "start.articulation_deg=20", "--set", "duration_s=0.5",
         "--out", str(folder)],
        env=dict(os.environ, **environment), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr
    with np.load(folder / "truth.npz") as kept:
        return {name: kept[name] for name in kept.files}


def test_python_and_machine_code_move_the_machine_alike(tmp_path: Path) -> None:
    python = truth_of_run(tmp_path / "python", NUMBA_DISABLE_JIT="1")
    compiled = truth_of_run(tmp_path / "compiled", NUMBA_DISABLE_JIT="0")
    assert python.keys() == compiled.keys()
    assert np.ptp(python["yaw"]) > 0.01  # rad: the machine turned
    for name, values in compiled.items():
        # last bits may differ: the order of sums is the compiler's
        largest = float(np.max(np.abs(values)))
        np.testing.assert_allclose(python[name], values, rtol=0.0, atol=1e-11 * largest, err_msg=name)
