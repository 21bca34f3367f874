"""The ECU of the tests, with both cores."""

import pytest

from tests.deploy.c.beside import put_beside
from tests.ecu.xcp.tool import CHANNEL, SECRET, Ecu


@pytest.fixture(params=["python", "c"])
def make_ecu(request):
    """Makes an ECU; with the core c, both cores have to answer alike in all that a test does."""
    if request.param == "python":
        return Ecu
    library = request.getfixturevalue("c_services")

    def made(*, secret=SECRET):
        return put_beside(Ecu(secret=secret), library, secret=secret, xcp=CHANNEL)

    return made
