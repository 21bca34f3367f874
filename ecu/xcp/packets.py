"""Codes of the XCP protocol layer 1.1, and the layouts of its commands and answers on classic CAN.

Source: ASAM MCD-1 XCP, part 2, as its command and error tables are publicly described.
"""

import enum
from typing import Final

MAX_CTO: Final = 8
MAX_DTO: Final = 8
RESPONSE: Final = 0xFF
ERROR: Final = 0xFE
EVENT: Final = 0xFD
MOST_ODTS: Final = 0xFC
"""Packet identifiers below this number are those of measured data."""


class Command(enum.IntEnum):
    """Commands that the ECU knows."""

    CONNECT = 0xFF
    DISCONNECT = 0xFE
    GET_STATUS = 0xFD
    SYNCH = 0xFC
    GET_COMM_MODE_INFO = 0xFB
    GET_ID = 0xFA
    GET_SEED = 0xF8
    UNLOCK = 0xF7
    SET_MTA = 0xF6
    UPLOAD = 0xF5
    SHORT_UPLOAD = 0xF4
    BUILD_CHECKSUM = 0xF3
    DOWNLOAD = 0xF0
    SET_CAL_PAGE = 0xEB
    GET_CAL_PAGE = 0xEA
    GET_PAG_PROCESSOR_INFO = 0xE9
    GET_SEGMENT_INFO = 0xE8
    GET_PAGE_INFO = 0xE7
    COPY_CAL_PAGE = 0xE4
    CLEAR_DAQ_LIST = 0xE3
    SET_DAQ_PTR = 0xE2
    WRITE_DAQ = 0xE1
    SET_DAQ_LIST_MODE = 0xE0
    GET_DAQ_LIST_MODE = 0xDF
    START_STOP_DAQ_LIST = 0xDE
    START_STOP_SYNCH = 0xDD
    GET_DAQ_CLOCK = 0xDC
    GET_DAQ_PROCESSOR_INFO = 0xDA
    GET_DAQ_RESOLUTION_INFO = 0xD9
    GET_DAQ_EVENT_INFO = 0xD7
    FREE_DAQ = 0xD6
    ALLOC_DAQ = 0xD5
    ALLOC_ODT = 0xD4
    ALLOC_ODT_ENTRY = 0xD3


class Error(enum.IntEnum):
    """Error codes of the standard."""

    CMD_SYNCH = 0x00
    DAQ_ACTIVE = 0x11
    CMD_UNKNOWN = 0x20
    CMD_SYNTAX = 0x21
    OUT_OF_RANGE = 0x22
    WRITE_PROTECTED = 0x23
    ACCESS_DENIED = 0x24
    ACCESS_LOCKED = 0x25
    PAGE_NOT_VALID = 0x26
    MODE_NOT_VALID = 0x27
    SEGMENT_NOT_VALID = 0x28
    SEQUENCE = 0x29
    DAQ_CONFIG = 0x2A
    MEMORY_OVERFLOW = 0x30


class Refused(Exception):
    """A command is answered by an error code."""

    def __init__(self, code: Error) -> None:
        super().__init__(code.name)
        self.code = code


EV_SESSION_TERMINATED: Final = 0x07


class Resource(enum.IntFlag):
    """What a slave offers, and what of it is protected."""

    CALIBRATION = 0x01
    DAQ = 0x04


LEAST_LENGTH: Final = {
    Command.CONNECT: 2,
    Command.GET_ID: 2,
    Command.GET_SEED: 3,
    Command.UNLOCK: 2,
    Command.SET_MTA: 8,
    Command.UPLOAD: 2,
    Command.SHORT_UPLOAD: 8,
    Command.BUILD_CHECKSUM: 8,
    Command.DOWNLOAD: 3,
    Command.SET_CAL_PAGE: 4,
    Command.GET_CAL_PAGE: 3,
    Command.GET_SEGMENT_INFO: 5,
    Command.GET_PAGE_INFO: 4,
    Command.COPY_CAL_PAGE: 5,
    Command.CLEAR_DAQ_LIST: 4,
    Command.SET_DAQ_PTR: 6,
    Command.WRITE_DAQ: 8,
    Command.SET_DAQ_LIST_MODE: 8,
    Command.GET_DAQ_LIST_MODE: 4,
    Command.START_STOP_DAQ_LIST: 4,
    Command.START_STOP_SYNCH: 2,
    Command.GET_DAQ_EVENT_INFO: 4,
    Command.ALLOC_DAQ: 4,
    Command.ALLOC_ODT: 5,
    Command.ALLOC_ODT_ENTRY: 6,
}
"""Bytes that a command has at least; 1 where it is not named. Longer ones are padded, which CAN permits."""
