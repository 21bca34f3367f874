"""udsoncan, a client that knows only the standard, identifies the ECU, reads its codes and restarts it."""

import zlib

import pytest
from udsoncan import services
from udsoncan.exceptions import NegativeResponseException

from ecu.calibration import calibration_table
from ecu.codes import Mode
from ecu.measure.measurements import measurements
from ecu.measure.pages import REFERENCE, CalibrationPages
from ecu.states import State
from ecu.uds.server import S3_NS
from tests.ecu.uds.tool import UdsEcu, tool

EXTENDED = services.DiagnosticSessionControl.Session.extendedDiagnosticSession


@pytest.fixture
def ecu(make_ecu):
    ecu = make_ecu()
    ecu.cycles(60)
    return ecu


@pytest.fixture
def client(ecu):
    with tool(ecu) as client:
        yield client


def refused(call, *arguments) -> str:
    """The name of the negative response to a call."""
    with pytest.raises(NegativeResponseException) as caught:
        call(*arguments)
    return caught.value.response.code_name


def silence(ecu: UdsEcu, *names: str) -> None:
    """Let messages be missing until their codes are there."""
    ecu.machine.silent |= set(names)
    ecu.cycles(60)


def test_the_ecu_is_identified(ecu, client):
    def read(identifier):
        return client.read_data_by_identifier(identifier).service_data.values[identifier]

    assert read(0xF190) == "LOADERHILL6000000"
    assert (read(0xF195), read(0xF1A0)) == ("1.2.3", "l60")
    # of the same bytes that a measuring tool finds on the reference page
    assert read(0xF1A1)[0] == zlib.crc32(CalibrationPages(ecu.cycle, calibration_table()).image(REFERENCE))


def test_estimates_are_read_together(ecu, client):
    wanted = [0x1000 + k for k in range(40)]
    values = client.read_data_by_identifier(wanted).service_data.values
    for k, row in enumerate(measurements()[:40]):
        assert values[0x1000 + k][0] == pytest.approx(ecu.cycle.values[row.key], rel=1e-6), row.name


def test_codes_are_read_with_status_and_freeze_frame(ecu, client):
    assert client.get_number_of_dtc_by_status_mask(0xFF).service_data.dtc_count == 0
    for k in range(21):  # no faster than a machine turns: a jump would be a code of its own
        ecu.machine.values["articulation_angle"] = 0.01 * k
        ecu.cycles(1)
    silence(ecu, "SlopeSensor")
    (code,) = ecu.cycle.trouble_codes.active
    (dtc,) = client.get_dtc_by_status_mask(0x01).service_data.dtcs
    assert dtc.id.to_bytes(3, "big") == bytes(
        (code.spn & 0xFF, code.spn >> 8 & 0xFF, code.spn >> 16 << 5 | code.mode)
    )
    assert (dtc.status.test_failed, dtc.status.confirmed) == (True, True)
    (known,) = client.get_dtc_snapshot_by_dtc_number(dtc.id, 1).service_data.dtcs
    frozen = {each.did: each.data[0] for each in known.snapshots}
    assert [frozen[0x0100 + k] for k in range(5)] == pytest.approx(list(code.frozen), rel=1e-6, abs=1e-12)
    assert frozen[0x0102] == pytest.approx(0.2, abs=1e-3)
    ecu.machine.silent.clear()
    ecu.cycles(130)
    assert client.get_dtc_by_status_mask(0x01).service_data.dtcs == []
    assert client.get_number_of_dtc_by_status_mask(0x08).service_data.dtc_count == 1


def test_supported_codes_hold_every_code_that_occurs(ecu, client):
    silence(ecu, "SlopeSensor", "LiftPressure")
    supported = {dtc.id for dtc in client.get_supported_dtc().service_data.dtcs}
    active = {dtc.id for dtc in client.get_dtc_by_status_mask(0x01).service_data.dtcs}
    assert len(active) == 2
    assert active <= supported
    assert len(supported) == len(ecu.cycle.trouble_codes.possible())


def test_clearing_forgets_what_is_over_and_keeps_what_is_there(ecu, client):
    silence(ecu, "SlopeSensor")
    ecu.machine.silent.clear()
    ecu.cycles(130)
    silence(ecu, "LiftPressure")
    assert refused(client.clear_dtc) == "ServiceNotSupportedInActiveSession"
    client.change_session(EXTENDED)
    assert refused(client.clear_dtc, 0x123456) == "RequestOutOfRange"
    client.clear_dtc()
    (code,) = ecu.cycle.trouble_codes.active
    assert (ecu.cycle.trouble_codes.previous, code.mode, code.occurrences) == ((), Mode.UPDATE_RATE, 1)


def test_a_restart_needs_session_key_and_a_standing_machine(ecu, client):
    assert refused(client.ecu_reset, 1) == "ServiceNotSupportedInActiveSession"
    client.change_session(EXTENDED)
    assert refused(client.ecu_reset, 1) == "SecurityAccessDenied"
    client.unlock_security_access(1)
    for n in range(1, 5):
        ecu.machine.values[f"wheel_speed_{n}"] = 3.0
    ecu.cycles(10)
    assert refused(client.ecu_reset, 1) == "ConditionsNotCorrect"
    for n in range(1, 5):
        ecu.machine.values[f"wheel_speed_{n}"] = 0.0
    ecu.cycles(60)
    client.ecu_reset(1)
    before = ecu.cycle.state
    ecu.machine.silent |= {"Articulation"}
    ecu.cycles(1)
    assert (before, ecu.cycle.state) == (State.RUNNING, State.INIT)
    assert ecu.cycle.values["limit speed"] == ecu.cycle.calibration.limits.safe_speed
    ecu.machine.silent.clear()
    ecu.cycles(20)
    assert ecu.cycle.state is State.RUNNING


def test_a_wrong_key_is_refused_and_three_of_them_bar_the_tool(ecu):
    with tool(ecu, secret=b"the secret of somebody else") as client:
        client.change_session(EXTENDED)
        answers = [refused(client.unlock_security_access, 1) for _ in range(4)]
    assert answers == ["InvalidKey", "InvalidKey", "ExceedNumberOfAttempts", "RequiredTimeDelayNotExpired"]


def test_the_self_test_says_whether_the_ecu_is_well(ecu, client):
    client.change_session(EXTENDED)
    assert refused(client.get_routine_result, 0x0201) == "RequestSequenceError"
    passed = client.start_routine(0x0201).service_data.routine_status_record
    silence(ecu, "SlopeSensor")
    failed = client.start_routine(0x0201).service_data.routine_status_record
    assert (passed[0], passed[1], failed[0], failed[2]) == (0, State.RUNNING, 1, 1)


def test_a_tester_that_is_present_keeps_its_session(ecu, client):
    client.change_session(EXTENDED)
    for _ in range(3):
        ecu.now_ns += S3_NS - 1
        client.tester_present()
    client.clear_dtc()
    ecu.now_ns += S3_NS + 1
    assert refused(client.clear_dtc) == "ServiceNotSupportedInActiveSession"
