"""The walk "change the roll-over equation", followed as printed in a copy of the tree."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "walks" / "change-the-rollover-equation.md").read_text(encoding="utf-8")
NEEDED = ("bus", "dbc", "ecu", "tests/ecu/estimators/test_rollover.py")


def block(language: str) -> str:
    """The page's code block in this language."""
    found = re.search(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert found, f"no block ```{language}"
    return found[1]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of what the walk touches."""
    for name in NEEDED:
        source, target = ROOT / name, tmp_path / name
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            target.parent.mkdir(parents=True)
            shutil.copy(source, target)
    return tmp_path


def edited(text: str, diff: str) -> str:
    """`text` after the page's edit; the lines to be changed stand in it exactly once."""
    body = diff.split("@@\n", 1)[1].splitlines(keepends=True)
    before = "".join(line[1:] for line in body if line[0] in " -")
    after = "".join(line[1:] for line in body if line[0] in " +")
    assert text.count(before) == 1
    return text.replace(before, after)


def laws(tree: Path, *only: str) -> tuple[int, set[str]]:
    """Exit status of the page's command in `tree`, and the names of the tests that failed. only: more arguments."""
    command = block("sh").split()
    assert command[:2] == ["NUMBA_DISABLE_JIT=1", "pytest"]
    environment = dict(os.environ, NUMBA_DISABLE_JIT="1", PYTHONPATH=str(tree))
    alone = ("-q", "-p", "no:cacheprovider", "-c", os.devnull, "--rootdir", str(tree))
    run = subprocess.run(
        [sys.executable, "-m", "pytest", *alone, *command[2:], *only],
        cwd=tree, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode in (0, 1), run.stdout + run.stderr
    return run.returncode, set(re.findall(r"^FAILED \S+::(\w+)", run.stdout, re.MULTILINE))


def test_the_edit_of_the_page_breaks_the_laws_it_names(copy):
    changed = re.search(r"^\+\+\+ b/(\S+)$", block("diff"), re.MULTILINE)
    assert changed
    source = copy / changed[1]
    before = source.read_text(encoding="utf-8")
    source.write_text(edited(before, block("diff")), encoding="utf-8")
    status, failed = laws(copy)
    named = re.findall(r"^FAILED (\w+)$", PAGE, re.MULTILINE)
    assert named
    assert (status, failed) == (1, set(named))
    source.write_text(before, encoding="utf-8")
    assert laws(copy, "-k", " or ".join(named)) == (0, set())


@pytest.mark.parametrize("path", re.findall(r"`((?:ecu|tests|plant|dbc)/[\w/.]+)`", PAGE))
def test_every_file_of_the_page_is_there(path):
    assert (ROOT / path).exists()


@pytest.mark.parametrize("name", re.findall(r"`RollOver\.(\w+)`", PAGE))
def test_every_signal_of_the_page_is_on_the_bus(name):
    assert f" SG_ {name} " in (ROOT / "dbc" / "loader.dbc").read_text(encoding="utf-8", errors="replace")
