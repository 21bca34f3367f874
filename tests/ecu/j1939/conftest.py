"""The network management of the tests, with both cores."""

import ctypes

import pytest

from dbc import loader_database
from ecu.j1939.name import Name
from ecu.j1939.service import j1939_service
from tests.deploy.c.beside import CServices, ServiceBeside

NAME = Name(identity=77, manufacturer=5)
DELAY = 10
"""What is drawn for the delay before a controller says that it has no address."""


class BothServices(ServiceBeside):
    """The service in Python, into which tests look, and that in C: every answer of both is compared, and whether they may send."""

    @property
    def state(self):
        """Of the address."""
        return self._python.state

    def may_send(self):
        """As both say it."""
        may = self._python.may_send()
        assert self._c.may_send() == may
        return may

    def receive(self, frame, now_ns):
        """What both answer."""
        return self._like(super().receive(frame, now_ns))

    def after_cycle(self, now_ns):
        """What both send."""
        return self._like(super().after_cycle(now_ns))

    def _like(self, frames):
        self.may_send()
        lost_to = self._python._claim.lost_to
        found = ctypes.c_uint64.in_dll(self._c.library, "tested_lost_to").value
        losses = ctypes.c_uint32.in_dll(self._c.library, "tested_losses").value
        assert (losses, found) == ((0, 0) if lost_to is None else (1, lost_to))
        return frames


@pytest.fixture(params=["python", "c"])
def service_named(request):
    """Makes a service with a NAME; with the core c, both cores have to answer alike in all that a test does."""

    def made(name=NAME):
        return j1939_service(
            name, loader_database(), calibration="l60", version="1.2.3", random=lambda: DELAY
        )

    if request.param == "python":
        return made
    library = request.getfixturevalue("c_services")
    return lambda name=NAME: BothServices(made(name), CServices(library, name=int(name)))
