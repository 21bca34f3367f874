"""findings.json read back."""

from pathlib import Path

from pydantic import ValidationError

from bus.mistake import Mistake
from discrepancy.findings import Findings, from_json


class NoFindings(Mistake, ValueError):
    """The file is no findings.json that can be read."""


def read_findings(path: Path) -> Findings:
    """The result of a diagnosis. Raises NoFindings."""
    try:
        return from_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise NoFindings(
            f"{path}: {error.strerror or error}; `loaderhil diagnose --out DIR` writes it"
        ) from error
    except (ValidationError, UnicodeDecodeError) as error:
        raise NoFindings(f"{path}: is no findings.json of this version") from error
