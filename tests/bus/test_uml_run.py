"""The runner that lends a machine without CAN a kernel that has it."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(shutil.which("linux.uml") is None, reason="user-mode-linux is not installed"),
]
UML_RUN = Path(__file__).resolve().parents[2] / "scripts" / "uml-run"


def uml_run(*command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [UML_RUN, *command], capture_output=True, text=True, timeout=100, env={**os.environ, **environment}
    )


def test_the_command_sees_our_files_arguments_and_environment_and_can(tmp_path: Path) -> None:
    script = (
        'pwd; echo "$1|$GREETING"; cat /sys/class/net/vcan?/operstate | wc -l; echo to stderr >&2; exit 7'
    )
    done = uml_run("sh", "-c", f"cd {tmp_path}; {script}", "sh", "a  'b\" $c", GREETING="x\ny z")
    assert done.stdout == f"{tmp_path}\na  'b\" $c|x\ny z\n2\nto stderr\n"
    assert done.returncode == 7


def test_a_command_that_hangs_is_ended_and_leaves_nothing_behind(tmp_path: Path) -> None:
    done = uml_run("sleep", "1000", UML_TIMEOUT_S="6", TMPDIR=str(tmp_path))
    assert done.returncode == 124
    assert "ended after 6 s (UML_TIMEOUT_S): sleep 1000" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_no_command_is_a_misuse() -> None:
    assert uml_run().returncode == 2
