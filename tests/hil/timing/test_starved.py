"""A run beside processes that take every processor: what is late is failed or inconclusive with the cause."""

import os
import subprocess
import sys
from contextlib import contextmanager

import pytest

from hil.ending import Ending
from hil.judgement import waits_of
from hil.rundir import RunDirectory
from hil.timing.host import LEAST_WAIT_NS
from hil.timing.waits import longest_of
from hil.verdict import Result
from tests.hil.processes.test_realtime import started, wait_until_running

pytestmark = [pytest.mark.processes, pytest.mark.timeout(240)]
HOGS_PER_PROCESSOR = 3


@contextmanager
def hogs():
    """Processes that never wait, on every processor this one may use; ended by their handles."""
    count = HOGS_PER_PROCESSOR * len(os.sched_getaffinity(0))
    running = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for hog in running:
            hog.kill()
        for hog in running:
            hog.wait()


def test_a_run_that_starvation_made_late_does_not_pass_and_names_the_cause(scenario, tmp_path):
    out = tmp_path / "run"
    with started("run", scenario(5.0), "--realtime", "--strict", "--out", out) as process:
        wait_until_running(process, out)
        with hogs():
            printed, errors = process.communicate(timeout=120)
    assert process.returncode == Ending.FAILED, errors  # strict: inconclusive counts
    record = RunDirectory.read(out).record
    assert record.vitals is not None
    assert max(life.worst_waited for life in record.vitals.lives) > 0.05
    waits = waits_of(RunDirectory.read(out))
    assert {"plant", "ecu", "hub"} >= set(waits) > set()
    assert longest_of(waits).waited_ns >= LEAST_WAIT_NS
    kept = record.punctuality
    assert kept is not None
    assert kept.ticks.result in (Result.INCONCLUSIVE, Result.FAILED)
    assert any(cause in kept.ticks.reason for cause in ("starved", "starts late", "skipped"))
    if kept.frames.result is not Result.PASSED:  # messages may be in time where a tick was not
        assert "starved" in kept.frames.reason or "late" in kept.frames.reason
    assert kept.ticks.reason in " ".join(printed.split())
