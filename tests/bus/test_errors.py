"""Error frames in words; the vectors follow include/uapi/linux/can/error.h."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.errors import BusFinding, Fault, findings
from bus.frame import ERROR, Frame
from tests.bus.laws import classic


def said(error_class: int, data: str) -> list[str]:
    return [str(finding) for finding in findings(Frame(ERROR | error_class, bytes.fromhex(data), 7))]


@pytest.mark.parametrize(
    ("error_class", "data", "says"),
    [
        (0x001, "00 00 00 00 00 00 00 00", ["transmission timed out"]),
        (0x002, "00 00 00 00 00 00 00 00", ["arbitration lost"]),
        (0x002, "11 00 00 00 00 00 00 00", ["arbitration lost (in bit 17)"]),
        (0x004, "00 00 00 00 00 00 00 00", ["controller problem (unspecified)"]),
        (0x004, "00 01 00 00 00 00 00 00", ["controller's receive buffer overflowed"]),
        (0x004, "00 08 00 00 00 00 60 00", ["error warning level reached (transmit errors)"]),
        (
            0x004,
            "00 30 00 00 00 00 80 80",
            [
                "controller is error passive (receive errors)",
                "controller is error passive (transmit errors)",
            ],
        ),
        (0x004, "00 40 00 00 00 00 00 00", ["controller is error active again"]),
        (0x008, "00 00 04 0A 00 00 00 00", ["protocol violation (bit stuffing; in data)"]),
        (0x008, "00 00 90 19 00 00 00 00", ["protocol violation (recessive bit could not be sent, while transmitting; in acknowledge slot)"]),
        (0x008, "00 00 00 00 00 00 00 00", ["protocol violation (unspecified)"]),
        (0x008, "00 00 01 1F 00 00 00 00", ["protocol violation (single bit; in location 0x1F)"]),
        (0x010, "00 00 00 00 70 00 00 00", ["transceiver problem (CAN low: short to ground)"]),
        (0x010, "00 00 00 00 99 00 00 00", ["transceiver problem (code 0x99)"]),
        (0x020, "00 00 00 00 00 00 00 00", ["no acknowledgement"]),
        (0x040, "00 00 00 00 00 00 00 00", ["bus off"]),
        (0x100, "00 00 00 00 00 00 00 00", ["controller restarted"]),
        (0x200, "00 00 00 00 00 00 7F 60", ["error counters (transmit 127, receive 96)"]),
        (0x0A8, "00 00 01 0B 00 00 00 00", ["no acknowledgement", "bus error", "protocol violation (single bit; in data length code)"]),
        (0x040, "", ["bus off"]),
    ],
)  # fmt: skip
def test_what_error_frames_say(error_class: int, data: str, says: list[str]) -> None:
    assert said(error_class, data) == says


def test_a_finding_has_the_stamp_of_its_frame() -> None:
    assert findings(Frame(ERROR | 0x40, bytes(8), 123)) == [BusFinding(Fault.BUS_OFF, 123)]


@given(classic)
def test_other_frames_say_nothing(frame: Frame) -> None:
    assert findings(frame) == []


@given(st.integers(1, 0x3FF), st.binary(max_size=8))
def test_every_class_that_is_set_is_reported(error_class: int, data: bytes) -> None:
    found = findings(Frame(ERROR | error_class, data))
    assert len(found) >= error_class.bit_count()
