"""Limits for untrusted DBC files: sizes that a bus can carry, and names that are safe in a path or an MQTT topic."""

import re
from pathlib import Path
from typing import Final

from dbc.errors import DatabaseError

FILE_LIMIT: Final = 32 << 20
"""Longest DBC file that is read [bytes]; those of whole cars have some 5 MB."""
LONGEST_MESSAGE: Final = 4095
"""Longest message [bytes]: a segmented one of ISO 15765-2. CAN XL carries 2048, a J1939 transport 1785."""
_MESSAGE: Final = re.compile(rb"^[ \t]*BO_[ \t]+\d+[ \t]+([^\s:]+)[ \t]*:[ \t]*(\d+)", re.MULTILINE)
_SIGNAL: Final = re.compile(rb"^[ \t]*SG_[ \t]+(\S+)[^:\n]*:[ \t]*(\d+)[ \t]*\|[ \t]*(\d+)", re.MULTILINE)
LARGEST_EXPONENT: Final = 308
"""Of a double."""
_TEXT: Final = re.compile(rb'"[^"]*"')
_POWER_OF_TEN: Final = re.compile(rb"\b\d[\d.]*[eE]\+?0*(\d{3,})")
_NAME: Final = re.compile(r"\w[\w.-]*")


def read_text(path: Path) -> bytes:
    """The content of a DBC file; DatabaseError where it cannot be read or is too long for one."""
    try:
        with path.open("rb") as file:
            text = file.read(FILE_LIMIT + 1)
    except OSError as error:
        raise DatabaseError(f"{path}: cannot read the DBC: {error.strerror or error}") from error
    if len(text) > FILE_LIMIT:
        raise DatabaseError(f"{path}: longer than {FILE_LIMIT >> 20} MiB; is this a DBC?")
    return text


def check_text(path: Path, text: bytes) -> None:
    """Refuse a DBC whose parser would need gigabytes or hours. Raises DatabaseError that names the message, or the line.

    cantools builds a table of all bits of a message, and writes out whole numbers in full; so sizes are looked at before.
    """
    for name, length in _MESSAGE.findall(text):
        # nine digits first: int() of a very long digit string is itself slow
        if len(length) > 9 or int(length) > LONGEST_MESSAGE:
            raise DatabaseError(
                f"{path}: message {_shown(name)}: {_shown(length)} bytes; at most {LONGEST_MESSAGE} are possible"
            )
    for name, *numbers in _SIGNAL.findall(text):
        if any(len(number) > 9 or int(number) > 8 * LONGEST_MESSAGE for number in numbers):
            raise DatabaseError(f"{path}: signal {_shown(name)}: lies outside any message")
    # (quoted text may hold anything; blanks keep the places)
    bare = _TEXT.sub(lambda quoted: b" " * len(quoted[0]), text)
    for number in _POWER_OF_TEN.finditer(bare):
        if len(number[1]) > 9 or int(number[1]) > LARGEST_EXPONENT:
            line = text.count(b"\n", 0, number.start()) + 1
            raise DatabaseError(
                f"{path}:{line}: {_shown(number[0])} is beyond every number that a computer calculates with"
            )


def _shown(text: bytes) -> str:
    return ascii(text[:40].decode("ascii", "replace"))[1:-1]


def check_name(kind: str, name: str) -> None:
    """Refuse a name that could leave a folder or a topic. Raises ValueError.

    Long names come from an attribute of the file that may hold any text.
    """
    if not _NAME.fullmatch(name) or ".." in name:
        raise ValueError(f"{kind} name {name[:60]!r}: letters, digits, _ and - only, as in C")
