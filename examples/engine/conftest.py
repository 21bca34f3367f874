"""A simulated engine on a bus inside this process; on hardware the address is socketcan:can0."""

from pathlib import Path

import pytest

from testbench.api import Bench, blocking


@pytest.fixture
def rig():
    dbc = Path(__file__).with_name("engine.dbc")
    with blocking(Bench.on_bus("virtual:engine", simulate=["Engine"], dbc=dbc)) as bench:
        yield bench
