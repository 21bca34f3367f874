"""Data sets that a model reads by itself, and what is to be complained of in the run directories of the bench."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dbc import loader_database, reference_database
from dbc.recording import read_frames
from discrepancy.recording import Complaint, Recording
from hil.diagnose.tables import Unreadable


@dataclass(frozen=True, slots=True)
class Native:
    """Recordings of a data set, and what was wrong with its files."""

    recordings: Sequence[Recording]
    complaints: Sequence[Complaint] = ()


def is_run(folder: Path) -> bool:
    """Whether a folder is a run directory of the bench."""
    return (folder / "bus.log").is_file()


def damage_of_run(folder: Path) -> list[Complaint]:
    """Damaged places in the logs of a run directory. Raises Unreadable for a log of another bus."""
    found = []
    for name, database in (("bus.log", loader_database()), ("reference.log", reference_database())):
        file = folder / name
        if not file.is_file():
            continue
        frames = read_frames(file)
        if not np.isin(frames.can_id, list(database.by_id)).any():
            raise Unreadable(
                f"{folder.name}: {name}: none of its {len(frames)} frames is of this bus; is it the log of another?"
            )
        if frames.damaged_count:
            text = f"{name}: {frames.damaged_count} damaged places, skipped; the first: {frames.damaged[0]}"
            found.append(Complaint(folder.name, "", text))
    return found
