"""Settings of a deployed ECU: the template is valid, and each mistake is one error that names its key."""

from pathlib import Path

import pytest

from configuration import ConfigurationError
from deploy.command import TEMPLATE
from deploy.settings import ServiceSettings
from ecu.offered.services import NO_SERVICES, ServiceOptions

LEAST = '[can]\ninterface = "can0"\n'


@pytest.fixture
def read(tmp_path):
    def reader(text):
        file = tmp_path / "ecu.toml"
        file.write_text(text, encoding="utf-8")
        return ServiceSettings.from_file(file)

    return reader


def test_the_template_names_the_usual_ecu():
    settings = ServiceSettings.from_file(TEMPLATE)
    assert settings.address == "socketcan:can0"
    assert settings.can.bit_rate == 500_000
    assert (settings.calibration, settings.form, settings.limits) == ("l60", "corrected", True)
    assert (settings.realtime.fifo, settings.realtime.cpu, settings.realtime.lock_memory) == (50, 1, True)


def test_only_the_interface_has_no_default(read):
    settings = read(LEAST)
    assert settings.limits
    assert settings.realtime.fifo is None
    with pytest.raises(ConfigurationError, match=r"ecu.toml: can.interface is missing"):
        read("")


def test_recorder_and_gateway_are_there_where_their_tables_are(read):
    least = read(LEAST)
    assert (least.recorder, least.gateway) == (None, None)
    settings = read(LEAST + '[recorder]\n[gateway]\nmachine_interface = "can1"\n')
    assert (settings.recorder.suffix, settings.recorder.rotate_mib) == ("blf", 64.0)
    assert (settings.gateway.machine_interface, settings.gateway.routes) == ("can1", None)


def test_what_the_ecu_offers_is_what_the_table_names(read):
    assert read(LEAST).offered == NO_SERVICES
    offered = read(LEAST + '[offered]\nj1939 = "identity=1,manufacturer=0"\naccess_key = "/etc/k"\n').offered
    assert offered == ServiceOptions(j1939="identity=1,manufacturer=0", access_key=Path("/etc/k"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[can]\ninterface = "../x"\n', "can.interface = '../x' is no name of a CAN interface"),
        ('[can]\ninterface = "can0; reboot"\n', "is no name of a CAN interface"),
        ('[can]\ninterface = "can0123456789012"\n', "at most 15 letters and digits"),
        (LEAST + "bit_rate_bit_s = 5\n", "can.bit_rate_bit_s = 5 is outside 10000..1000000"),
        (LEAST + "bitrate = 500000\n", "can.bitrate is not a known key"),
        (LEAST + "listen_s = 0.0\n", "can.listen_s = 0.0 s is outside 0.1..60 s"),
        (LEAST + '[ecu]\nform = "new"\n', "ecu.form = 'new' is not one of corrected, printed"),
        (LEAST + "[realtime]\nfifo = 100\n", "realtime.fifo = 100 is outside 1..99"),
        (LEAST + "[service]\nwatchdog_s = 0.01\n", "service.watchdog_s = 0.01 s is outside 0.2..60 s"),
        (LEAST + '[ecu]\ncore = "rust"\n', "ecu.core = 'rust' is not one of python, c"),
        (
            LEAST + '[recorder]\nformat = "pcap"\n',
            "recorder.format = 'pcap' is not one of blf, log, asc, mf4",
        ),
        (
            LEAST + '[gateway]\nmachine_interface = "can0"\n',
            "gateway.machine_interface = 'can0' is the ECU's own",
        ),
        (LEAST + "[gateway]\n", "gateway.machine_interface is missing"),
        (LEAST + "[watchdog]\n", "watchdog is not a known key"),
        (LEAST + "[offered]\nisobus = 1\n", "offered.isobus is not a known key"),
        (
            LEAST + '[ecu]\ncalibration = "l60\\nUser=root"\n',
            "ecu.calibration = 'l60\\nUser=root' has a control",
        ),
        (
            LEAST + '[gateway]\nmachine_interface = "can1"\nroutes = "/r\\r"\n',
            "gateway.routes = '/r\\r' has a control",
        ),
        (LEAST + '[offered]\nxcp = "1,\\t2"\n', "offered.xcp = '1,\\t2' has a control"),
        (LEAST + '[offered]\naccess_key = "/k\\n"\n', "offered.access_key = '/k\\n' has a control"),
    ],
)
def test_a_mistake_is_named_with_its_key(read, text, said):
    with pytest.raises(ConfigurationError) as raised:
        read(text)
    assert said in str(raised.value)
