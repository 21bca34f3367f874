"""Data sets that a model reads itself, and complaints about run directories of the bench."""

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
    """A data set that a model has read."""

    recordings: Sequence[Recording]
    complaints: Sequence[Complaint] = ()  # errors of its files
    machine: str | None = None  # name or file of the machine, where the data set states it


def is_run(folder: Path) -> bool:
    """Whether a folder is a run directory of the bench."""
    return (folder / "bus.log").is_file()


def machine_of_run(folder: Path) -> str | None:
    """Name or file of the machine of a run; None without run.json. Raises RunError for a damaged one."""
    return read_record(folder).machine if (folder / RECORD).is_file() else None


def damage_of_run(folder: Path) -> list[Complaint]:
    """Complaints about damaged places in the logs of a run directory, and about an unusable reference.log.

    Raises LogError or Unreadable for an unusable bus.log: without it there is nothing to judge.
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
        text = f"reference.log: {why}; left out; the machine's own bus is still judged"
        found.append(Complaint(folder.name, "", text))
    return found


def _damage(file: Path, database: Database) -> list[Complaint]:
    """A complaint if a log has damaged places. Raises LogError, or Unreadable for the log of another bus."""
    frames = read_frames(file)
    run = file.parent.name
    if not np.isin(frames.can_id, list(database.by_id)).any():
        raise Unreadable(
            f"{run}: {file.name}: none of its {len(frames)} frames belongs to this bus; is it the log of another bus?"
        )
    if not frames.damaged_count:
        return []
    text = f"{file.name}: {frames.damaged_count} damaged places, skipped; the first: {frames.damaged[0]}"
    return [Complaint(run, "", text)]
