"""The walk "add a signal", followed as printed in a copy of the tree."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dbc.columns import ColumnDecoder
from dbc.database import Database
from dbc.recordings.reading import read_frames

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "walks" / "add-a-signal.md").read_text(encoding="utf-8")
TOLERANCE_DEG = 0.05  # of a mean of 20 readings: noise 0.03 deg each, resolution 0.02 deg


def blocks(language: str) -> list[str]:
    """The page's code blocks in this language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


def edited(text: str, diff: str) -> str:
    """`text` after the page's edit; the lines around each change stand in it exactly once."""
    for hunk in diff.split("@@\n")[1:]:
        lines = hunk.splitlines(keepends=True)
        before = "".join(line[1:] for line in lines if line[0] in " -")
        after = "".join(line[1:] for line in lines if line[0] in " +")
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    return text


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the packages with the page's edits, in which the page's commands have run."""
    copy = tmp_path_factory.mktemp("signal")
    for package in sorted(path.parent for path in ROOT.glob("*/__init__.py")):
        if package.name not in ("tests", "bench"):
            # machine code of what the page does not edit comes with it; the plant's is large, and does not fit any more
            left_out = shutil.ignore_patterns("__pycache__") if package.name == "plant" else None
            shutil.copytree(package, copy / package.name, ignore=left_out)
    for diff in blocks("diff"):
        changed = re.search(r"^\+\+\+ b/(\S+)$", diff, re.MULTILINE)
        assert changed
        file = copy / changed[1]
        file.write_text(edited(file.read_text(encoding="utf-8"), diff), encoding="utf-8")
    (commands,) = blocks("sh")
    for command in commands.splitlines():
        assert command.startswith("loaderhil ")
        # half a second of motion takes seconds in Python, and to compile plant and ECU minutes; a report's pictures need machine code
        in_python = str(int(command.startswith("loaderhil run")))
        run = subprocess.run(
            [sys.executable, "-m", "loaderhil", *command.split()[1:]],
            cwd=copy, env=dict(os.environ, PYTHONPATH=str(copy), NUMBA_DISABLE_JIT=in_python),
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert run.returncode == 0, run.stdout + run.stderr
    return copy


def test_the_sensor_is_on_the_bus_and_follows_the_truth(tree: Path) -> None:
    frames = read_frames(tree / "out/signal/bus.log")
    decoded = ColumnDecoder(Database.from_file(tree / "dbc/loader.dbc")).decode(frames)
    reading = np.asarray(decoded["LinkageAngles"].signals["OscillationAngle"], float)
    truth = np.load(tree / "out/signal/truth.npz")["oscillation_angle"]
    true_deg = float(np.degrees(truth[-1]))
    assert abs(true_deg) > 4.0 * TOLERANCE_DEG
    assert reading[-20:].mean() == pytest.approx(true_deg, abs=TOLERANCE_DEG)
    assert np.ptp(reading) > 0.0


def test_the_ecu_finds_nothing_wrong_with_it(tree: Path) -> None:
    frames = read_frames(tree / "out/signal/bus.log")
    status = ColumnDecoder(Database.from_file(tree / "dbc/loader.dbc")).decode(frames)["EcuStatus"]
    assert not np.asarray(status.signals["StaleInputs"], float)[-10:].any()


def test_the_report_draws_reading_and_truth(tree: Path) -> None:
    page = (tree / "out/signal.html").read_text(encoding="utf-8")
    (title,) = re.findall(r'"(Oscillation of the rear axle[^"]*)"', PAGE)
    assert title in page
    assert "sensor" in page[page.index(title) :]


@pytest.mark.parametrize("path", re.findall(r"`((?:ecu|plant|dbc|report)/[\w/.]+)`", PAGE))
def test_every_file_of_the_page_is_there(path: str) -> None:
    assert (ROOT / path).exists()
