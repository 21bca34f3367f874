"""The ECU in C in the place of the Python one: on a hub as `loaderhil ecu --core c`, on a CAN interface as the exported Linux program."""

import json
import signal
import subprocess
from contextlib import contextmanager

import numpy as np
import pytest

from dbc import loader_database
from dbc.recordings.logfile import read_candump
from deploy.c.core import C
from hil import rundir
from tests.bus.conftest import vcan  # noqa: F401
from tests.bus.vcan import INTERFACE
from tests.deploy.c.building import compiler
from tests.deploy.c.conftest import CALIBRATION
from tests.deploy.c.test_targets import make
from tests.examples.test_foreign_nodes import hub, loaderhil, results, running, short  # noqa: F401
from tests.testbench.conform.test_conform import conform

SENT = [codec.can_id for codec in loader_database().by_name.values() if "EstimatorEcu" in codec.senders]


@contextmanager
def switched_on(program):
    """The exported program on the interface; it has to end well when it is switched off."""
    with subprocess.Popen([program, INTERFACE]) as ecu:
        try:
            yield
            ecu.send_signal(signal.SIGTERM)
            assert ecu.wait(timeout=20) == 0
        finally:
            ecu.kill()


@pytest.fixture
def built():
    """The library of the C core: a process that is waited for must not compile first."""
    compiler()
    C.ecu(CALIBRATION)


@pytest.fixture
def program(ecu_sources):
    """The exported Linux program."""
    compiler()
    make(ecu_sources, "linux/loader-ecu")
    return ecu_sources / "linux/loader-ecu"


@pytest.mark.processes
@pytest.mark.timeout(600)
@pytest.mark.usefixtures("built")
class TestOnAHub:
    def test_a_run_in_real_time_takes_it(self, short, tmp_path):  # noqa: F811
        done = loaderhil("run", short, "--realtime", "--ecu-core", "c", "--out", tmp_path / "run")
        record = json.loads((tmp_path / "run" / rundir.RECORD).read_text())
        assert (record["ecu_core"], record["outcome"]) == ("c", "finished"), done.stderr
        assert np.isin(read_candump(tmp_path / "run" / rundir.BUS).can_id, SENT).sum() > 100

    def test_what_it_does_not_have_ends_the_process_with_one_line(self, hub):  # noqa: F811
        done = loaderhil("ecu", "--core", "c", "--form", "printed", "--bus", f"hub:{hub}")
        assert done.returncode == 2
        assert "--form printed: not in the ECU's C core" in done.stderr


@pytest.mark.socketcan
@pytest.mark.usefixtures("vcan")
@pytest.mark.timeout(600)
class TestTheLinuxProgram:
    def test_it_conforms(self, program, tmp_path):
        _, found = conform(f"socketcan:{INTERFACE}", tmp_path, node=switched_on(program))
        # A user-mode kernel is slow and drops frames, which counters and cycle times show; contents do not depend on it.
        kinds = (": presence", ": length", ": CRC", ": range", ": value table", ": initial values")
        content = {name: said for name, said in found.items() if name.endswith(kinds)}
        assert content
        assert set(content.values()) == {"PASSED"}, content
        # nor does what it does without an input
        assert found["loss of BodyRates: state after loss"] != "FAILED", found

    def test_it_stands_in_a_run(self, program, short, tmp_path):  # noqa: F811
        with switched_on(program):
            done = loaderhil(
                "run", short, "--ecu", f"socketcan:{INTERFACE}", "--out", tmp_path / "out", "--json"
            )
        found = results(done)
        assert found["EstimatorEcu is there throughout"][0] != "FAILED", found
        assert np.isin(read_candump(tmp_path / "out" / rundir.BUS).can_id, SENT).sum() > 100
