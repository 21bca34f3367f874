"""What the tests of the ECU's services share."""

import pytest

from tests.deploy.c.beside import services_library


@pytest.fixture(scope="session")
def c_services(tmp_path_factory):
    """The library of the C host build with its services."""
    return services_library(tmp_path_factory.mktemp("services"))
