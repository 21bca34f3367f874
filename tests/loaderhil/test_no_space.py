"""A disk that is really full, a small tmpfs of the test's own: one line, exit code 1, and what was written before stays."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from hil.ending import Ending
from hil.rundir import RunDirectory, read_record

MOUNT = ["unshare", "--user", "--map-root-user", "--mount"]


def can_mount() -> bool:
    """Whether this user may mount a tmpfs in a namespace of its own; many containers forbid it."""
    if shutil.which("unshare") is None:
        return False
    tried = subprocess.run(
        [*MOUNT, "mount", "-t", "tmpfs", "tmpfs", "/mnt"], capture_output=True, timeout=60, check=False
    )
    return tried.returncode == 0


pytestmark = pytest.mark.skipif(
    not can_mount(), reason="no tmpfs of our own here; test_full_disk has the stand-in"
)


@dataclass(frozen=True)
class Ended:
    """A command on a small disk."""

    code: int
    errors: list[str]
    kept: Path
    """A copy of what it left on that disk, which went with its namespace."""


def on_small_disk(tmp_path: Path, size: str, *words: object) -> Ended:
    """`loaderhil WORDS`, DISK in them standing for a disk of this size."""
    disk, kept = tmp_path / "disk", tmp_path / "kept"
    disk.mkdir()
    kept.mkdir()
    script = 'mount -t tmpfs -o size="$1" tmpfs "$2" && shift && disk=$1 && kept=$2 && shift 2 && { "$@"; code=$?; cp -r "$disk/." "$kept"; exit $code; }'
    command = [sys.executable, "-m", "loaderhil", *(str(word).replace("DISK", str(disk)) for word in words)]
    done = subprocess.run(
        [*MOUNT, "sh", "-c", script, "sh", size, disk, kept, *command],
        capture_output=True, text=True, timeout=240, check=False, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    assert "Traceback" not in done.stderr, done.stderr
    return Ended(
        done.returncode, [line for line in done.stderr.splitlines() if line.startswith("loaderhil:")], kept
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short run in lockstep."""
    out = tmp_path_factory.mktemp("run") / "run"
    command = [
        sys.executable,
        "-m",
        "loaderhil",
        "run",
        "standstill",
        "--set",
        "duration_s=1",
        "--out",
        str(out),
    ]
    subprocess.run(command, capture_output=True, timeout=240, check=True)
    return out


@pytest.mark.processes
def test_a_run_in_lockstep_keeps_what_fitted_and_its_record(tmp_path):
    ended = on_small_disk(tmp_path, "1m", "run", "loaded", "--out", "DISK/run")
    assert ended.code == Ending.FAILED
    (line,) = ended.errors
    assert "No space left on device" in line
    record = read_record(ended.kept / "run")
    assert record.outcome == "failed"
    assert "bus.log: cannot be written: No space left" in record.reason
    assert len(RunDirectory.read(ended.kept / "run").messages["Articulation"].time_s) > 100


@pytest.mark.processes
def test_a_run_in_real_time_keeps_what_was_written_and_why_it_ended(tmp_path):
    ended = on_small_disk(tmp_path, "1m", "run", "loaded", "--realtime", "--out", "DISK/run")
    assert ended.code == Ending.PEER_DIED
    (line,) = ended.errors
    assert "No space left on device" in line
    run = RunDirectory.read(ended.kept / "run")
    assert run.record.outcome == "failed"
    assert "process" in run.record.reason
    assert "No space left on device" in run.record.reason
    ticks = len(run.messages["Articulation"].time_s)
    assert ticks > 50
    # whichever of them found the disk full first, the others had as long
    assert len(run.truth["time_s"]) > ticks / 2


@pytest.mark.processes
@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("report", "RUN", "--out", "DISK/report.html"), "report.html"),
        (("compare", "RUN", "RUN", "--out", "DISK/compare.html"), "compare.html"),
        (("decode", "RUN/bus.log", "--out", "DISK/t"), ".csv"),
        (("decode", "RUN/bus.log", "--out", "DISK/t", "--format", "parquet"), ".parquet"),
        (("export", "RUN/bus.log", "--out", "DISK/a.mcap"), "a.mcap"),
        (("render", "RUN", "--out", "DISK/a.png"), "a.png"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_what_does_not_fit_is_one_line_that_names_the_file(tmp_path, run, words, named):
    ended = on_small_disk(tmp_path, "16k", *(str(word).replace("RUN", str(run)) for word in words))
    assert ended.code == Ending.FAILED
    (line,) = ended.errors
    assert f"{named}: cannot be written: " in line
    assert "No space left on device" in line
    left = [file for file in ended.kept.rglob("*") if file.is_file()]
    assert not [file for file in left if file.name.endswith(named)] or "decode" in words, "half a file"
