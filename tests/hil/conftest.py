"""Runs that several test modules look at, and the shortest scenario that can be run."""

from collections.abc import Callable
from pathlib import Path

import pytest

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
