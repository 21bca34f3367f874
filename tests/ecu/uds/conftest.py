"""The ECU of the tests, with both cores."""

import pytest

from tests.deploy.c.beside import put_beside, services_library
from tests.ecu.uds.tool import CHANNEL, UdsEcu
from tests.ecu.xcp.tool import SECRET


@pytest.fixture(scope="session")
def c_services(tmp_path_factory):
    """The library of the C host build with its services."""
    return services_library(tmp_path_factory.mktemp("services"))


@pytest.fixture(params=["python", "c"])
def make_ecu(request):
    """Makes an ECU; with the core c, both cores have to answer alike in all that a test does."""
    if request.param == "python":
        return UdsEcu
    library = request.getfixturevalue("c_services")
    return lambda: put_beside(UdsEcu(), library, secret=SECRET, uds=CHANNEL)
