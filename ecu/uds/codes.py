"""Codes of ISO 14229-1 that the ECU uses."""

import enum


class Service(enum.IntEnum):
    """Service identifiers of requests; an answer has 0x40 more."""

    SESSION_CONTROL = 0x10
    ECU_RESET = 0x11
    CLEAR_DIAGNOSTIC_INFORMATION = 0x14
    READ_DTC_INFORMATION = 0x19
    READ_DATA = 0x22
    SECURITY_ACCESS = 0x27
    ROUTINE_CONTROL = 0x31
    TESTER_PRESENT = 0x3E


class Negative(enum.IntEnum):
    """Why a request is refused."""

    SERVICE_NOT_SUPPORTED = 0x11
    SUBFUNCTION_NOT_SUPPORTED = 0x12
    WRONG_LENGTH = 0x13
    RESPONSE_TOO_LONG = 0x14
    CONDITIONS_NOT_CORRECT = 0x22
    SEQUENCE_ERROR = 0x24
    OUT_OF_RANGE = 0x31
    SECURITY_ACCESS_DENIED = 0x33
    INVALID_KEY = 0x35
    TOO_MANY_ATTEMPTS = 0x36
    DELAY_NOT_EXPIRED = 0x37
    SERVICE_NOT_IN_SESSION = 0x7F


class Session(enum.IntEnum):
    """What a tool may do; EXTENDED ends by itself when the tool falls silent."""

    DEFAULT = 0x01
    EXTENDED = 0x03


class Status(enum.IntFlag):
    """Bits of a trouble code's status that the ECU keeps."""

    TEST_FAILED = 0x01  # active
    FAILED_THIS_CYCLE = 0x02
    CONFIRMED = 0x08
    FAILED_SINCE_CLEAR = 0x20


KEPT = Status.TEST_FAILED | Status.FAILED_THIS_CYCLE | Status.CONFIRMED | Status.FAILED_SINCE_CLEAR


class Refused(Exception):
    """A request has a negative response."""

    def __init__(self, code: Negative) -> None:
        super().__init__(code.name)
        self.code = code
