"""Reads JSON from untrusted senders, for the hub, the control socket and MQTT: bounded size and depth, one error type."""

import json
import re
from typing import Any, Final

DEPTH: Final = 8
"""Deepest nesting that a message may have. The deepest of ours, a fault table in a command, has 3."""
_STRING: Final = re.compile(rb'"(?:[^"\\]|\\.)*"?', re.DOTALL)
_BRACKET: Final = re.compile(rb"[\[\]{}]")


def read_object(text: bytes, limit: int) -> dict[str, Any]:
    """The JSON object in `text`, of at most `limit` bytes. Raises ValueError that says what is wrong."""
    if len(text) > limit:
        raise ValueError(f"{len(text)} bytes; at most {limit} are read")
    # json.loads recurses: a thousand nested brackets fit into one packet and end in a RecursionError,
    # which is no ValueError and would end the server
    if _depth(text) > DEPTH:
        raise ValueError(f"nested more than {DEPTH} deep")
    try:
        # NaN and Infinity are accepted by Python's parser but are not JSON; a fault's value must be finite
        message = json.loads(text, parse_constant=_refuse_constant)
    except UnicodeDecodeError as error:
        raise ValueError(f"not UTF-8: byte {error.start} is 0x{text[error.start]:02X}") from None
    if not isinstance(message, dict):
        raise ValueError(f"a JSON {type(message).__name__}, not an object")
    return message


def _depth(text: bytes) -> int:
    """Deepest nesting of brackets outside strings."""
    depth = deepest = 0
    # strings are removed first: a bracket inside a text does not nest
    for bracket in _BRACKET.findall(_STRING.sub(b"", text)):
        depth += 1 if bracket in b"[{" else -1
        deepest = max(deepest, depth)
    return deepest


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON number")


def printable(text: str, limit: int = 64) -> str:
    """Untrusted text made safe for one line of a terminal or log: control characters and surrogates as \\x.., cut at `limit`."""
    cut = text if len(text) <= limit else f"{text[: limit - 3]}..."
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in cut)
