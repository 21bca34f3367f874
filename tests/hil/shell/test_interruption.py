"""Ctrl-C while a command computes: one line, exit code 130, no file that is half of one, and no waiting for threads or the compiler."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from diagnosis.reading.csv_writer import csv_text
from discrepancy.models.loader.channels import INPUTS, SPEEDS
from discrepancy.signals.recording import Recording
from discrepancy.signals.recording import signal as channel
from hil.ending import Ending
from hil.shell.interruption import ended_at_once

pytestmark = pytest.mark.processes
PATIENCE_S = 100.0
"""For a process to start, or to end, on a busy machine; what takes longer hangs."""

BUSY_THREAD = """
import time
from concurrent.futures import ThreadPoolExecutor
from hil.shell.interruption import ended_at_once

with ended_at_once(0.1), ThreadPoolExecutor(1) as pool:
    pool.submit(time.sleep, 3600.0)
    print("busy", flush=True)
    time.sleep(3600.0)
"""


def test_a_thread_that_computes_on_does_not_keep_the_process() -> None:
    """Without the block this process would wait an hour for its pool."""
    with subprocess.Popen(
        [sys.executable, "-c", BUSY_THREAD], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "busy\n"
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, errors) == (Ending.INTERRUPTED, "loaderhil: interrupted\n")


def test_a_diagnosis_that_compiles_is_interrupted(tmp_path: Path) -> None:
    """The folder for compiled code is empty, so the plant is compiled first: a minute in which Python answers no signal."""
    time_s, rng = np.arange(0.0, 10.0, 0.01), np.random.default_rng(1)
    units = {**INPUTS, **dict.fromkeys(SPEEDS, "rad/s")}
    signals = {name: channel(time_s, rng.normal(2.0, 0.1, time_s.size), unit) for name, unit in units.items()}
    (tmp_path / "drive.csv").write_text(csv_text(Recording("drive", signals)))
    code, out, applied = tmp_path / "code", tmp_path / "out", tmp_path / "applied" / "mine.toml"
    words = ["diagnose", tmp_path / "drive.csv", "--model", "loader", "--out", out, "--apply", applied]
    with subprocess.Popen(
        [sys.executable, "-m", "loaderhil", *map(str, words)],
        env=os.environ | {"NUMBA_CACHE_DIR": str(code)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        until = time.monotonic() + PATIENCE_S
        while not any(code.glob("plant-*/*/*.nbi")):  # the first function has been compiled
            assert time.monotonic() < until
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == Ending.INTERRUPTED
    assert errors.splitlines()[-1] == "loaderhil: interrupted"
    assert errors.count("interrupted") == 1
    assert "Traceback" not in errors
    assert said == ""
    assert list(out.iterdir()) == []
    assert list(applied.parent.iterdir()) == []


def test_a_block_that_ends_by_itself_leaves_signals_as_they_were() -> None:
    before = signal.getsignal(signal.SIGINT)
    with ended_at_once(0.1):
        pass
    assert signal.getsignal(signal.SIGINT) is before
    assert signal.set_wakeup_fd(-1) == -1
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
