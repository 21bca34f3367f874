"""Keeps what was read of DBC files, for `dbc.database`: a file that was read before needs no cantools.

cantools with python-can takes more than a third of the processor time of a process that only reads our DBC files. What is kept
is found by the content of the file and belongs to one state of our reader and one version of cantools. It is JSON with a
checksum before it: what is damaged, or of somebody else, counts as not there. Only what could be read is kept, so that a
damaged DBC has the same error every time.
"""

import hashlib
import importlib.metadata
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any, Final

import bus.bounded_json
from bus.cache_folder import NoCacheFolderError, cache_folder, digest_of
from dbc.conduct import LossConduct, NodeConduct
from dbc.definitions.definition import Definition, MessageDefinition
from dbc.signal import Signal

FOLDER: Final = Path(__file__).resolve().parents[1]
MOST_FILES: Final = 16
"""Files that are kept, the newest ones: a bench has a handful, a loop over generated files would fill the disk."""
MOST_BYTES: Final = 16 << 20
"""Longest file that is kept; the DBC of a whole car takes some 10 MB here."""


def recall(text: bytes, *, strict: bool) -> Definition | None:
    """What was kept of a DBC with this content; None where that is nothing, or nothing usable."""
    try:
        checksum, _, body = (_folder() / _name(text, strict=strict)).read_bytes().partition(b"\n")
        if checksum != _checksum(body):
            return None
        return _definition(json.loads(body))
    except (OSError, NoCacheFolderError, ValueError, TypeError, KeyError, AttributeError):
        return None


def keep(text: bytes, definition: Definition, *, strict: bool) -> None:
    """Keep what was read of a DBC with this content, if it can be."""
    try:
        body = json.dumps(asdict(definition), default=_listed, separators=(",", ":")).encode()
        exact = _definition(json.loads(body)) == definition
    except (ValueError, TypeError):  # an attribute of the DBC holds something that JSON does not know
        return
    if not exact or len(body) > MOST_BYTES:
        return
    # without a place to write to, or on a full disk, the next start reads the DBC itself
    with suppress(OSError, NoCacheFolderError):
        file = _folder() / _name(text, strict=strict)
        # another process may read it meanwhile, and this one may be killed
        fresh = file.with_suffix(f".{os.getpid()}")
        fresh.write_bytes(_checksum(body) + b"\n" + body)
        fresh.replace(file)
        _forget_oldest(file.parent)


def _folder() -> Path:
    # the variable by which a user moves the machine code moves this too: one place to empty
    return cache_folder(FOLDER, "definitions", _reader(), os.environ.get("NUMBA_CACHE_DIR"))


@cache
def _reader() -> str:
    """Fingerprint of what turns text into definitions: cantools and the sources of this package."""
    sources = [
        *sorted(FOLDER.glob("*.py")),
        *sorted(FOLDER.glob("definitions/*.py")),
        Path(bus.bounded_json.__file__),
    ]
    return f"{digest_of(sources)}-{importlib.metadata.version('cantools')}"


def _name(text: bytes, *, strict: bool) -> str:
    return f"{hashlib.sha256(text).hexdigest()}{'' if strict else '-lenient'}.json"


def _checksum(body: bytes) -> bytes:
    return hashlib.sha256(body).hexdigest().encode()


def _forget_oldest(folder: Path) -> None:
    newest_first = sorted(folder.iterdir(), key=lambda file: file.stat().st_mtime_ns, reverse=True)
    for file in newest_first[MOST_FILES:]:
        file.unlink(missing_ok=True)


def _listed(value: Any) -> list[int]:
    """What JSON has in place of a set."""
    if not isinstance(value, frozenset):
        raise TypeError(f"{type(value).__name__} is not kept")
    return sorted(value)


def _definition(read: Mapping[str, Any]) -> Definition:
    nodes = {name: NodeConduct(**node) for name, node in read["nodes"].items()}
    return Definition(tuple(map(_message, read["messages"])), nodes)


def _message(read: Mapping[str, Any]) -> MessageDefinition:
    profile = read["profile"]
    rebuilt: dict[str, Any] = {
        "senders": tuple(read["senders"]),
        "receivers": tuple(read["receivers"]),
        "layout": tuple(map(_signal, read["layout"])),
        "profile": None if profile is None else tuple(profile),
        "conduct": LossConduct(**read["conduct"]),
    }
    return MessageDefinition(**{**read, **rebuilt})


def _signal(read: Mapping[str, Any]) -> Signal:
    rebuilt: dict[str, Any] = {
        "receivers": tuple(read["receivers"]),
        "choices": {int(value): name for value, name in read["choices"].items()},
        "multiplexer_ids": frozenset(read["multiplexer_ids"]),
    }
    return Signal(**{**read, **rebuilt})
