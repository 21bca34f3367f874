"""The truth of a concealed recording, sealed: not readable by a glance, bound to the recording, opened by `loaderhil score`.

A seal against oneself, not against an adversary: compressed and base64, with SHA-256 of the recording it belongs to.
"""

import base64
import binascii
import hashlib
import json
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from bus.user_error import UserError
from diagnosis.blind.hidden import Truth
from diagnosis.findings_file import with_present_names

HEAD = "loaderhil truth 1, sealed; open it with: loaderhil score FINDINGS THIS"


class BrokenSeal(UserError, ValueError):
    """Not a sealed truth, or not a whole one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sealed:
    """The truth, and SHA-256 of the files it is true of, by name."""

    truth: Truth
    files: dict[str, str]


_ADAPTER = TypeAdapter(Sealed)


def digest(path: Path) -> str:
    """SHA-256 of a file, or of the names and digests of all files of a folder."""
    if path.is_dir():
        told = (f"{f.relative_to(path)} {digest(f)}" for f in sorted(path.rglob("*")) if f.is_file())
        return hashlib.sha256("\n".join(told).encode()).hexdigest()
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def seal(truth: Truth, files: Sequence[Path]) -> str:
    """Text of the sealed file."""
    plain = json.dumps(asdict(Sealed(truth=truth, files={f.name: digest(f) for f in files})))
    hidden = base64.b64encode(zlib.compress(plain.encode(), 9)).decode()
    lines = [hidden[i : i + 76] for i in range(0, len(hidden), 76)]
    return "\n".join([HEAD, *lines, ""])


def unseal(path: Path) -> Sealed:
    """Open a sealed file. Raises BrokenSeal."""
    try:
        head, *lines = path.read_text(encoding="utf-8").splitlines()
        if head != HEAD:
            raise BrokenSeal(f"{path}: is no sealed truth; `loaderhil conceal` writes truth.sealed")
        plain = zlib.decompress(base64.b64decode("".join(lines), validate=True)).decode()
        return _ADAPTER.validate_json(with_present_names(plain, _ADAPTER.validate_json(plain).truth.model))
    except BrokenSeal:
        raise
    except (OSError, UnicodeDecodeError, ValidationError, ValueError, binascii.Error, zlib.error) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "damaged or cut off"
        raise BrokenSeal(f"{path}: the sealed truth cannot be opened: {reason}") from error
