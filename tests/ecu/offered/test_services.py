"""An ECU offers what it was asked for and nothing else, and says what it cannot offer."""

from typing import cast

import pytest

from ecu.calibration import calibration_table, read_calibration
from ecu.core import Ecu
from ecu.cycle import EcuCycle
from ecu.j1939.service import J1939Service
from ecu.measure.channel import ChannelError
from ecu.offered.services import NO_SERVICES, ServiceOptions, ServicesError, services_of
from ecu.uds.service import UdsService
from ecu.xcp.service import XcpService

XCP, UDS, J1939 = "0x600,0x601", "0x610,0x611", "identity=1,manufacturer=0"


@pytest.fixture(scope="module")
def table():
    return calibration_table()


@pytest.fixture
def cycle(table):
    return EcuCycle(read_calibration(table))


@pytest.mark.parametrize(
    ("options", "kinds"),
    [
        (NO_SERVICES, []),
        (ServiceOptions(xcp=XCP), [XcpService]),
        (ServiceOptions(uds=UDS), [UdsService]),
        (ServiceOptions(xcp=XCP, uds=UDS), [XcpService, UdsService]),
        (ServiceOptions(j1939=J1939, xcp=XCP), [J1939Service, XcpService]),
    ],
)
def test_what_is_asked_for_is_offered(cycle, table, options, kinds):
    assert [type(service) for service in services_of(cycle, table, options)] == kinds


def test_two_services_need_identifiers_of_their_own(cycle, table):
    with pytest.raises(ServicesError, match="share an identifier"):
        services_of(cycle, table, ServiceOptions(xcp=XCP, uds="0x601,0x602"))
    with pytest.raises(ChannelError, match="two CAN identifiers"):
        services_of(cycle, table, ServiceOptions(uds="0x601"))


def test_another_core_than_python_offers_nothing(table):
    foreign = cast(Ecu, object())
    assert services_of(foreign, table, NO_SERVICES) == []
    assert len(services_of(foreign, table, ServiceOptions(j1939=J1939))) == 1
    with pytest.raises(ServicesError, match="--core"):
        services_of(foreign, table, ServiceOptions(xcp=XCP))
