"""The machines that come with the bench."""

import pytest

from studies.standards.table import candidate_of


@pytest.fixture(scope="session")
def l60():
    return candidate_of("l60", None, [])


@pytest.fixture(scope="session", params=["l60", "compact"])
def candidate(request):
    """Either machine: what a law says holds for both."""
    return candidate_of(request.param, None, [])
