"""docs/howto/test-in-python.md, followed as printed; and what the plugin leaves of a test that fails."""

import os
import re
import subprocess
import sys
from xml.etree import ElementTree as ET

import pytest

from hil.rundir import RunDirectory
from tests.docs.pages import ROOT

pytestmark = pytest.mark.processes  # each test starts a pytest or a python
PAGE = (ROOT / "docs/howto/test-in-python.md").read_text("utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def run(folder, *words):
    # The plugin is named here, so that it is this checkout's and not an installed one's.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "testbench.pytest_plugin",
        "-p",
        "no:cacheprovider",
        *words,
    ]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=280)


@pytest.mark.timeout(300)
def test_the_printed_tests_pass_as_printed(tmp_path):
    (tmp_path / "test_gyro.py").write_text(BLOCKS[0])
    done = run(tmp_path, "test_gyro.py")
    assert "2 passed" in done.stdout, done.stdout
    assert not (tmp_path / "out").exists()  # recordings of tests that passed are not kept


@pytest.mark.timeout(300)
def test_the_printed_program_runs_as_printed(tmp_path):
    (tmp_path / "program.py").write_text(BLOCKS[1])
    done = subprocess.run(
        [sys.executable, "program.py"],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=280,
    )  # fmt: skip
    assert re.fullmatch(r"running at 0\.\d{3} s\n", done.stdout), done.stderr


@pytest.mark.timeout(300)
def test_a_failure_has_its_recording_attached(tmp_path):
    (tmp_path / "test_wrong.py").write_text(
        "def test_it_degrades_by_itself(bench):\n"
        "    bench.run_for(0.5)\n"
        "    bench.expect('EcuStatus.State == degraded', within_s=0.2)\n"
    )
    done = run(tmp_path, "test_wrong.py", "--junit-xml", "results.xml", "--bench-recordings", "kept")
    assert done.returncode == 1
    assert "EcuStatus.State was running" in done.stdout
    (folder,) = (tmp_path / "kept").iterdir()
    assert f"loaderhil recording: kept/{folder.name}" in done.stdout
    assert RunDirectory.read(folder).truth["time_s"].size == 70
    prop = ET.parse(tmp_path / "results.xml").find(".//property[@name='loaderhil recording']")
    assert prop is not None
    assert prop.get("value") == f"kept/{folder.name}"
