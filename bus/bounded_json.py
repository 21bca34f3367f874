"""Reads JSON from strangers, for the hub, the control socket and MQTT: bounded in size and depth, one kind of error.

Python's parser recurses: a thousand nested brackets, which fit into one packet, end in a RecursionError that no reader of
packets expects.
"""

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
    if _depth(text) > DEPTH:
        raise ValueError(f"nested more than {DEPTH} deep")
    try:
        message = json.loads(text, parse_constant=_refuse_constant)
    except UnicodeDecodeError as error:
        raise ValueError(f"not UTF-8: byte {error.start} is 0x{text[error.start]:02X}") from None
    if not isinstance(message, dict):
        raise ValueError(f"a JSON {type(message).__name__}, not an object")
    return message


def _depth(text: bytes) -> int:
    """Deepest nesting of brackets outside strings."""
    depth = deepest = 0
    for bracket in _BRACKET.findall(_STRING.sub(b"", text)):
        depth += 1 if bracket in b"[{" else -1
        deepest = max(deepest, depth)
    return deepest


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON number")


def printable(text: str, limit: int = 64) -> str:
    """Text of a stranger on one line of a terminal or log: control characters and surrogates as \\x.., cut at `limit`."""
    cut = text if len(text) <= limit else f"{text[: limit - 3]}..."
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in cut)
