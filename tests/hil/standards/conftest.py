"""The machine that comes with the bench."""

import pytest

from hil.standards.table import candidate_of


@pytest.fixture(scope="session")
def l60():
    return candidate_of("l60", "l60", [])
