"""Weighings as a sheet: one row each, headings with units ('articulation [deg]', 'front_left [kN]')."""

from pathlib import Path

import numpy as np

from identify.machine.weighing import Weighing
from identify.sheet import read_sheet

ANGLES = ("articulation", "grade", "bank")
LOADS = ("front_left", "front_right", "rear_left", "rear_right")


def read_weighings(path: Path) -> list[Weighing]:
    """All rows of a CSV file; grade and bank may be missing, which is level ground. Raises BadRecording."""
    units = dict.fromkeys(ANGLES, "rad") | dict.fromkeys(LOADS, "N")
    sheet = read_sheet(path, units, ("articulation", *LOADS), "weighings")
    loads = np.stack([sheet[name] for name in LOADS], axis=1)
    level = np.zeros(loads.shape[0])
    angles = [np.nan_to_num(sheet.get(name, level)).tolist() for name in ANGLES]
    return [
        Weighing(loads=row, articulation=articulation, grade=grade, bank=bank)
        for row, articulation, grade, bank in zip(loads, *angles, strict=True)
    ]
