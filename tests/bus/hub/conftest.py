"""A path for a hub, and a hub that runs there."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.bus.hub.running import RunningHub


@pytest.fixture
def path(tmp_path: Path) -> str:
    return str(tmp_path / "hub")


@pytest.fixture
def hub(path: str) -> Iterator[RunningHub]:
    running = RunningHub(path)
    yield running
    running.stop()
