"""The examples of a simulated engine pass as they stand."""

import os
import subprocess
import sys

import pytest

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
