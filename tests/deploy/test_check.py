"""What the check says of an interface and of a bus, before a deployed ECU sends."""

import subprocess
import threading
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from bus.address import open_transport
from bus.frame import Frame
from bus.socketcan.link import Link
from configuration import ConfigurationError
from dbc import loader_database
from deploy.check import ALONE, GATEWAY, HEALTHY, INTERFACE, MACHINE, Heard, check, judge, judge_interface
from deploy.command import TEMPLATE
from deploy.settings import GatewaySettings, ServiceSettings
from ecu.offered.services import ServiceOptions
from hil.foreign.silence import identifiers_of
from hil.shell.realtime_options import RealtimeOptions
from hil.verdict import Result
from tests.bus.conftest import vcan  # noqa: F401
from tests.bus.vcan import INTERFACE as VCAN

SETTINGS = ServiceSettings.from_file(TEMPLATE)
DATABASE = loader_database()
LIMITS, MOTION = DATABASE.by_name["Limits"].can_id, DATABASE.by_name["Articulation"].can_id
MACHINE_FRAMES = Counter({MOTION: 100})


def results(heard, settings=SETTINGS):
    return {verdict.question: verdict for verdict in judge(settings, heard, DATABASE)}


@pytest.mark.parametrize(
    ("link", "said"),
    [
        (None, "there is no interface can0"),
        (Link(can=False, up=True, carrier=True), "is not a CAN interface"),
        (Link(can=True, up=False, carrier=False), "ip link set can0 up type can bitrate 500000"),
        (Link(can=True, up=True, carrier=False), "bus-off"),
    ],
)
def test_an_interface_that_cannot_send_is_refused_with_a_cause(link, said):
    verdict = judge_interface(SETTINGS, link)
    assert verdict.result is Result.FAILED
    assert said in verdict.reason


ANY_CPU = replace(SETTINGS, realtime=RealtimeOptions())
CAN1 = GatewaySettings(machine_interface="can1", routes=None)


def refusal(settings):
    with pytest.raises(ConfigurationError) as raised:
        check(settings)
    return str(raised.value)


@pytest.mark.parametrize(
    ("changed", "key", "said"),
    [
        ({"offered": ServiceOptions(j1939="identity=1")}, "offered.j1939", "manufacturer"),
        ({"offered": ServiceOptions(xcp="0x601")}, "offered.xcp", "0x601"),
        (
            {"offered": ServiceOptions(uds="0x601,0x602", access_key=Path("/none"))},
            "offered.access_key",
            "/none",
        ),
        (
            {"offered": ServiceOptions(xcp="0x601,0x602", uds="0x601,0x603")},
            "offered ",
            "share an identifier",
        ),
        ({"core": "c", "offered": ServiceOptions(xcp="0x601")}, "offered.xcp", "0x601"),
        ({"core": "c", "form": "printed"}, "ecu.core", "--form printed"),
        ({"calibration": "l61"}, "ecu.calibration", "'l61'"),
        ({"realtime": RealtimeOptions(cpu=4000)}, "realtime.cpu", "= 4000"),
        ({"gateway": replace(CAN1, routes="/none/routes.toml")}, "gateway.routes", "/none/routes.toml"),
    ],
)
def test_a_setting_that_cannot_be_used_is_named_before_the_bus_is_heard(changed, key, said, monkeypatch):
    monkeypatch.setattr("deploy.check.listen", lambda *_: pytest.fail("it listened"))
    refused = refusal(replace(ANY_CPU, **changed))
    assert refused.startswith(f"{SETTINGS.file}: {key}")
    assert said in refused


def test_a_route_that_the_gateway_would_refuse_is_refused(tmp_path):
    routes = tmp_path / "routes.toml"
    routes.write_text('[[route]]\nmessage = "VehicleSpede"\nfrom = "plant"\npass = false\n')
    refused = refusal(replace(ANY_CPU, gateway=replace(CAN1, routes=str(routes))))
    assert "gateway.routes" in refused
    assert "did you mean 'VehicleSpeed'" in refused


def test_the_gateway_needs_its_other_interface_too():
    verdicts = check(replace(ANY_CPU, gateway=replace(CAN1, machine_interface="canzzz")))
    assert "there is no interface canzzz" in {v.question: v for v in verdicts}[GATEWAY].reason


def test_a_machine_alone_on_the_bus_passes():
    found = results(Heard(frames=MACHINE_FRAMES))
    assert {verdict.result for verdict in found.values()} == {Result.PASSED}
    assert set(found) == {ALONE, HEALTHY, MACHINE}


def test_any_message_of_the_ecu_is_another_ecu():
    ours = identifiers_of("EstimatorEcu", DATABASE)
    assert LIMITS in ours
    for can_id in ours:
        verdict = results(Heard(frames=MACHINE_FRAMES + Counter({can_id: 3})))[ALONE]
        assert verdict.result is Result.FAILED
        assert f"{DATABASE.by_id[can_id].name} (3 frames)" in verdict.reason


def test_a_silent_machine_is_refused_only_on_request():
    needs = replace(SETTINGS, can=replace(SETTINGS.can, needs_machine=True))
    assert results(Heard())[MACHINE].result is Result.INCONCLUSIVE
    assert results(Heard(), needs)[MACHINE].result is Result.FAILED


def test_error_frames_are_refused():
    assert results(Heard(frames=MACHINE_FRAMES, errors=2))[HEALTHY].result is Result.FAILED


@pytest.mark.socketcan
class TestOnVcan:
    """The same on a real CAN interface of the kernel."""

    quick = replace(ANY_CPU, can=replace(SETTINGS.can, interface=VCAN, listen_s=0.5))

    @pytest.fixture
    def traffic(self, vcan):  # noqa: F811
        """Sends frames of one identifier until the test ends."""
        stop = threading.Event()

        def start(can_id):
            def send():
                with open_transport(f"socketcan:{VCAN}") as bus:
                    while not stop.wait(0.01):
                        bus.send(Frame(can_id=can_id, data=bytes(8)))

            thread = threading.Thread(target=send, daemon=True)
            thread.start()
            threads.append(thread)

        threads = []
        yield start
        stop.set()
        for thread in threads:
            thread.join(5.0)

    def test_the_machine_alone_passes(self, traffic):
        traffic(MOTION)
        assert {verdict.result for verdict in check(self.quick)} == {Result.PASSED}

    def test_a_second_ecu_is_named(self, traffic):
        traffic(LIMITS)
        verdict = {v.question: v for v in check(self.quick)}[ALONE]
        assert verdict.result is Result.FAILED
        assert "Limits" in verdict.reason

    def test_an_interface_that_is_down_is_refused_unheard(self, vcan, monkeypatch):  # noqa: F811
        monkeypatch.setattr("deploy.check.listen", lambda *_: pytest.fail("it listened"))
        subprocess.run(["ip", "link", "set", VCAN, "down"], check=True)
        try:
            (verdict,) = check(self.quick)
        finally:
            subprocess.run(["ip", "link", "set", VCAN, "up"], check=True)
        assert verdict.question == INTERFACE
        assert verdict.result is Result.FAILED
