"""The ECU of the tests, with both cores."""

import pytest

from tests.deploy.c.beside import put_beside
from tests.ecu.uds.tool import CHANNEL, UdsEcu
from tests.ecu.xcp.tool import SECRET


@pytest.fixture(params=["python", "c"])
def make_ecu(request):
    """Makes an ECU; with the core c, both cores have to answer alike in all that a test does."""
    if request.param == "python":
        return UdsEcu
    library = request.getfixturevalue("c_services")
    return lambda: put_beside(UdsEcu(), library, secret=SECRET, uds=CHANNEL)
