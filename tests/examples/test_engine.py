"""The examples of a simulated engine pass as they stand."""

import os
import subprocess
import sys

import pytest

from hil.rundir import RunDirectory
from tests.docs.pages import ROOT

FOLDER = ROOT / "examples/engine"


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_the_examples_pass():
    # The plugin is named here, so that it is this checkout's and not an installed one's.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    words = [
        "-p",
        "testbench.pytest_plugin",
        "-p",
        "no:cacheprovider",
        "-c",
        os.devnull,
        "--rootdir",
        str(FOLDER),
    ]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", *words, str(FOLDER)],
        env=environment, capture_output=True, text=True, timeout=280,
    )  # fmt: skip
    assert "8 passed" in done.stdout, done.stdout


def robot(*words, cwd):
    """Robot Framework with these words; its output and results are in `cwd`."""
    return subprocess.run(
        [sys.executable, "-m", "robot", *map(str, words)],
        env={**os.environ, "PYTHONPATH": str(ROOT)}, cwd=cwd, capture_output=True, text=True, timeout=280,
    )  # fmt: skip


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_the_example_for_robot_framework_passes(tmp_path):
    done = robot(FOLDER / "engine.robot", cwd=tmp_path)
    assert "3 tests, 3 passed, 0 failed" in done.stdout, done.stdout


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_robot_framework_gets_the_recording_of_a_test_that_fails_and_a_clear_line_without_a_bench(tmp_path):
    suite = tmp_path / "fails.robot"
    suite.write_text(
        "*** Settings ***\nLibrary    testbench.robot_library.BenchLibrary\n"
        "*** Test Cases ***\nIt Is Degraded\n    Start Bench    standstill\n    Run For    500 ms\n"
        "    Expect    EcuStatus.State == degraded    within=100 ms\n"
        "No Bench\n    Run For    50 ms\n"
    )
    done = robot(suite, cwd=tmp_path)
    assert "2 tests, 0 passed, 2 failed" in done.stdout
    assert "degraded within 100 ms of 0.500 s: EcuStatus.State was running" in done.stdout
    assert RunDirectory.read(tmp_path / "out/robot/Fails.It_Is_Degraded").messages
    # the bench of the test before has ended with it
    assert "no bench runs: begin the test with `Start Bench`" in done.stdout
