"""Reads findings.json, of this and earlier versions, for the commands that work on a finished diagnosis."""

import re
from pathlib import Path

from pydantic import ValidationError

from bus.user_error import UserError
from discrepancy.signals.findings import Findings, from_json


class NoFindings(UserError, ValueError):
    """The file is not a readable findings.json."""


OLD_CHANNEL = re.compile(r"\bacceleration_([xyz])\b")
"""Names of the loader's channels specific_force_x, y, z before version 0.2."""


def with_present_names(text: str, model: str) -> str:
    """The text of a file about a model, with the channels named as today."""
    return OLD_CHANNEL.sub(r"specific_force_\1", text) if model == "loader" else text


def read_findings(path: Path) -> Findings:
    """The result of a diagnosis, channels named as today. Raises NoFindings."""
    try:
        text = path.read_text(encoding="utf-8")
        return from_json(with_present_names(text, from_json(text).model))
    except OSError as error:
        raise NoFindings(
            f"{path}: {error.strerror or error}; `loaderhil diagnose --out DIR` writes it"
        ) from error
    # RecursionError: the first look at the model's name is json's, which calls itself for every bracket
    except (ValidationError, ValueError, RecursionError) as error:
        raise NoFindings(f"{path}: is not a findings.json that this version can read") from error
