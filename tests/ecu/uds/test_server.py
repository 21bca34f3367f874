"""The UDS server has the standard's negative response for every malformed request, and no bytes disturb the ECU."""

import random

import pytest

from bus.frame import Frame
from ecu.uds.codes import Negative, Service
from tests.ecu.uds.tool import CHANNEL, UdsEcu


@pytest.fixture
def ecu(make_ecu):
    ecu = make_ecu()
    ecu.cycles(20)
    return ecu


def ask(ecu: UdsEcu, request: str) -> bytes:
    """The answer to a request that fits into one frame, without length and padding."""
    data = bytes.fromhex(request)
    frames = ecu.service.receive(Frame(CHANNEL.receive, bytes((len(data),)) + data), ecu.now_ns)
    if not frames:
        return b""
    (frame,) = frames
    return frame.data[1 : 1 + frame.data[0]]


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        ("01", Negative.SERVICE_NOT_SUPPORTED),
        ("3e", Negative.WRONG_LENGTH),
        ("3e0000", Negative.WRONG_LENGTH),
        ("3e01", Negative.SUBFUNCTION_NOT_SUPPORTED),
        ("1002", Negative.SUBFUNCTION_NOT_SUPPORTED),
        ("22f1", Negative.WRONG_LENGTH),
        ("22ffff", Negative.OUT_OF_RANGE),
        ("1977", Negative.SUBFUNCTION_NOT_SUPPORTED),
        ("1902", Negative.WRONG_LENGTH),
        ("190400000101", Negative.OUT_OF_RANGE),
        ("2701", Negative.SERVICE_NOT_IN_SESSION),
        ("1101", Negative.SERVICE_NOT_IN_SESSION),
        ("31010201", Negative.SERVICE_NOT_IN_SESSION),
    ],
)
def test_what_is_malformed_has_its_negative_response(ecu, request_, code):
    assert ask(ecu, request_) == bytes((0x7F, int(request_[:2], 16), code))


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        ("1102", Negative.SUBFUNCTION_NOT_SUPPORTED),
        ("1101", Negative.SECURITY_ACCESS_DENIED),
        ("2703", Negative.SUBFUNCTION_NOT_SUPPORTED),
        ("2702aabb", Negative.SEQUENCE_ERROR),
        ("31050201", Negative.SUBFUNCTION_NOT_SUPPORTED),
        ("3101ffff", Negative.OUT_OF_RANGE),
        ("31030201", Negative.SEQUENCE_ERROR),
        ("14ffff", Negative.WRONG_LENGTH),
    ],
)
def test_the_same_holds_in_the_extended_session(ecu, request_, code):
    assert ask(ecu, "1003") == bytes.fromhex("5003003201f4")
    assert ask(ecu, request_) == bytes((0x7F, int(request_[:2], 16), code))


def test_a_positive_answer_can_be_suppressed_and_a_negative_cannot(ecu):
    assert ask(ecu, "3e80") == b""
    assert ask(ecu, "1082") == bytes((0x7F, 0x10, Negative.SUBFUNCTION_NOT_SUPPORTED))


def test_random_frames_disturb_no_estimate_and_fill_no_log(make_ecu, caplog):
    rng = random.Random(3)
    ecu, plain = make_ecu(), make_ecu()
    services = list(Service)
    for _ in range(50):
        for _ in range(60):
            data = bytearray(rng.randbytes(rng.randint(1, 8)))
            if rng.random() < 0.8:  # single frames of known services reach deeper than noise
                data[0] = len(data) - 1
                data[1:2] = bytes((rng.choice(services),))
            for frame in ecu.service.receive(Frame(CHANNEL.receive, bytes(data[:8])), ecu.now_ns):
                assert frame.can_id == CHANNEL.send
                assert len(frame.data) == 8
        ecu.cycles(1)
        plain.cycles(1)
        assert ecu.cycle.values == plain.cycle.values
    assert caplog.records == []
