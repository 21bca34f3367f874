"""The sealed truth of a concealed recording: not readable by eye, bound to the recording, opened by `loaderhil score`.

The text is compressed and in base64, and holds the SHA-256 of the recording. It keeps a tester from reading the truth by accident; it
does not protect against somebody who wants to read it. Encryption would need a key that lies in the same program.
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
    """The file is not a sealed truth, or is damaged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sealed:
    """The content of truth.sealed."""

    truth: Truth
    files: dict[str, str]  # SHA-256 of the recording's files, by name


_ADAPTER = TypeAdapter(Sealed)


def digest(path: Path) -> str:
    """SHA-256 in hexadecimal of a file, or of the names and digests of all files in a folder."""
    if path.is_dir():
        lines = (f"{f.relative_to(path)} {digest(f)}" for f in sorted(path.rglob("*")) if f.is_file())
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def seal(truth: Truth, files: Sequence[Path]) -> str:
    """The text of truth.sealed for these files of a recording."""
    plain = json.dumps(asdict(Sealed(truth=truth, files={f.name: digest(f) for f in files})))
    hidden = base64.b64encode(zlib.compress(plain.encode(), 9)).decode()
    lines = [hidden[i : i + 76] for i in range(0, len(hidden), 76)]
    return "\n".join([HEAD, *lines, ""])


def unseal(path: Path) -> Sealed:
    """The content of a sealed file, with channels named as today. Raises BrokenSeal."""
    try:
        head, *lines = path.read_text(encoding="utf-8").splitlines()
        if head != HEAD:
            raise BrokenSeal(f"{path}: is not a sealed truth; `loaderhil conceal` writes truth.sealed")
        plain = zlib.decompress(base64.b64decode("".join(lines), validate=True)).decode()
        return _ADAPTER.validate_json(with_present_names(plain, _ADAPTER.validate_json(plain).truth.model))
    except BrokenSeal:
        raise
    except (OSError, UnicodeDecodeError, ValidationError, ValueError, binascii.Error, zlib.error) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "damaged or cut off"
        raise BrokenSeal(f"{path}: the sealed truth cannot be opened: {reason}") from error
