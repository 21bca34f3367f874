"""Drives without a fault that were driven by an earlier commit: hours and alarms, kept in a file for the page.

Ten hours cost an hour of a processor. They hold for a later commit as long as what makes an alarm is the same; who is named by it may change.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bus.user_error import UserError
from studies.campaigns.batch import Result, commit

_KEPT = ("what", "kind", "hours", "alarms")


@dataclass(frozen=True, slots=True)
class Driven:
    """Drives of one run of the campaign."""

    command: str
    commit: str
    results: tuple[Result, ...]  # those keys of the campaign's results that say how long and which alarms


def keep(file: Path, results: Sequence[Result], command: str) -> None:
    """Write what `read_driven` reads."""
    rows = [{key: result[key] for key in _KEPT} for result in results]
    lines = ",\n".join(json.dumps(row) for row in rows)
    head = f'{{"command": {json.dumps(command)}, "commit": {json.dumps(commit())}, "results": [\n'
    file.write_text(head + lines + "\n]}\n", encoding="utf-8")


def read_driven(file: Path) -> Driven:
    """The drives of a file of `keep`. Raises UserError."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        rows = tuple({key: row[key] for key in _KEPT} for row in found["results"])
        return Driven(str(found["command"]), str(found["commit"]), rows)
    except OSError as error:
        raise UserError(f"{file}: {error.strerror}") from error
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"{file}: no drives that `studies.faults --keep` wrote ({error!r})") from error
