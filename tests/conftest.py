"""Tests run stricter than use: floating-point trouble is an error, and what must run may not skip.

$LOADERHIL_MUST_RUN names markers (socketcan, browser, processes, mqtt, ...); a test that carries one of
them and skips is then a failure. Continuous integration sets it.
"""

import os
import signal
from collections.abc import Callable, Generator
from pathlib import Path

import can.io.mf4  # noqa: F401  # before dbc.lean hides asammdf from python-can, whose MF4 writer is a reference in tests
import hypothesis
import numpy as np
import pytest

# a suite started in the background of a shell would hand on that Ctrl-C is ignored
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
np.seterr(divide="raise", over="raise", invalid="raise")
# the same examples in every run, however busy the machine is
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None)
hypothesis.settings.load_profile("repeatable")

ROOT = Path(__file__).resolve().parent.parent
MUST_RUN = frozenset(os.environ.get("LOADERHIL_MUST_RUN", "").split())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Turn a skip into a failure where the machine was said to have what the test needs."""
    report = yield
    needed = MUST_RUN.intersection(mark.name for mark in item.iter_markers())
    if report.skipped and needed and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.longrepr = f"must run here (LOADERHIL_MUST_RUN has {', '.join(sorted(needed))}): {reason}"
    return report


CHOSEN_BY_TEXT = frozenset({"slow", "processes", "browser", "socketcan"})
"""Marks by which the Makefile chooses files: it looks for `mark.NAME` in them, because to import all of them takes half a minute."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A mark that the file does not show would keep its tests from running in `make test`."""
    texts: dict[Path, str] = {}
    for item in items:
        for name in CHOSEN_BY_TEXT.intersection(mark.name for mark in item.iter_markers()):
            if item.path not in texts:
                texts[item.path] = item.path.read_text(encoding="utf-8")
            if f"mark.{name}" not in texts[item.path]:
                raise pytest.UsageError(f"{item.path}: write pytest.mark.{name} in the file itself")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder with the public recordings: $LOADERHIL_DATA, or ../shared/data beside the checkout."""
    folder = Path(os.environ.get("LOADERHIL_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recordings in {folder}; set LOADERHIL_DATA or run scripts/fetch-data")
    return folder


STANDS = """
name = "short"
sentence = "Stands."
duration_s = {duration_s}
machine = "l60"
seed = 1

[driver.speed_kmh]
points = [[0.0, 0.0]]
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Callable[[float], Path]:
    """Writes the file of a scenario that stands for so many seconds."""

    def make(duration_s: float) -> Path:
        file = tmp_path / "short.toml"
        file.write_text(STANDS.format(duration_s=duration_s))
        return file

    return make


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The abrupt turn in lockstep, the ECU's limits off, then on."""
    from hil.compose import Choice
    from hil.runs import run_lockstep

    folder = tmp_path_factory.mktemp("runs")
    for limits in (False, True):
        run_lockstep(Choice(scenario="abrupt_articulation", limits=limits), folder / f"limits_{limits}")
    return [folder / "limits_False", folder / "limits_True"]
