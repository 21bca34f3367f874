"""`loaderhil compile` with nothing compiled before: what it leaves when it is ended early."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from hil.ending import Ending
from tests.children import alive, command_lines

pytestmark = pytest.mark.processes
START_S = 60.0


@pytest.fixture
def compiling(tmp_path) -> Iterator[subprocess.Popen[str]]:
    """The command, while both of its processes compile; a group of its own, as a shell starts it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "loaderhil", "compile"],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + START_S
    while not all(list(tmp_path.glob(f"{part}-*/*/*.nbi")) for part in ("plant", "estimators")):
        assert time.monotonic() < deadline, list(tmp_path.iterdir())
        assert process.poll() is None, process.communicate()
        time.sleep(0.1)
    yield process
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


def workers(process: subprocess.Popen[str]) -> list[int]:
    return [pid for pid, words in command_lines(process.pid).items() if "spawn_main" in " ".join(words)]


def test_ctrl_c_ends_it_with_its_processes(compiling):
    ours = workers(compiling)
    assert len(ours) >= 2  # one per processor
    os.killpg(compiling.pid, signal.SIGINT)
    said, _ = compiling.communicate(timeout=START_S)
    assert compiling.returncode == Ending.INTERRUPTED
    assert "Traceback" not in said
    assert not any(alive(pid) for pid in ours)


def test_a_process_that_dies_is_named(compiling):
    """The kernel ends one where memory is short."""
    os.kill(workers(compiling)[0], signal.SIGKILL)
    said, _ = compiling.communicate(timeout=START_S)
    assert compiling.returncode == Ending.PEER_DIED
    assert re.search("compiles the (ECU|plant) ended with signal 9", said)
    assert "Traceback" not in said
