"""Data sets that a model reads by itself, and what is to be complained of in the run directories of the bench."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dbc import loader_database, reference_database
from dbc.database import Database
from dbc.errors import LogError
from dbc.recordings.reading import read_frames
from diagnosis.reading.tables import Unreadable
from discrepancy.signals.recording import Complaint, Recording
from hil.rundir import RECORD, read_record


@dataclass(frozen=True, slots=True)
class Native:
    """Recordings of a data set, what was wrong with its files, and the machine (name or file) that it says it is of."""

    recordings: Sequence[Recording]
    complaints: Sequence[Complaint] = ()
    machine: str | None = None


def is_run(folder: Path) -> bool:
    """Whether a folder is a run directory of the bench."""
    return (folder / "bus.log").is_file()


def machine_of_run(folder: Path) -> str | None:
    """The machine that a run directory was made with; None where it has no record. Raises RunError for one that is damaged."""
    return read_record(folder).machine if (folder / RECORD).is_file() else None


def damage_of_run(folder: Path) -> list[Complaint]:
    """Damaged places in the logs of a run directory, and a reference.log that is of no use.

    Raises LogError or Unreadable for a bus.log that is of none.
    """
    found = _damage(folder / "bus.log", loader_database())
    try:
        if (folder / "reference.log").is_file():
            found += _damage(folder / "reference.log", reference_database())
    except (LogError, Unreadable) as error:
        why = (
            str(error)
            .removeprefix(f"{folder / 'reference.log'}: ")
            .removeprefix(f"{folder.name}: reference.log: ")
        )
        text = f"reference.log: {why}; left out, the machine's own bus is judged"
        found.append(Complaint(folder.name, "", text))
    return found


def _damage(file: Path, database: Database) -> list[Complaint]:
    frames = read_frames(file)
    run = file.parent.name
    if not np.isin(frames.can_id, list(database.by_id)).any():
        raise Unreadable(
            f"{run}: {file.name}: none of its {len(frames)} frames is of this bus; is it the log of another?"
        )
    if not frames.damaged_count:
        return []
    text = f"{file.name}: {frames.damaged_count} damaged places, skipped; the first: {frames.damaged[0]}"
    return [Complaint(run, "", text)]
