"""The Plaza 1 recording as one table: a row per measured distance, with the mower's place at that moment.

    python -m bench.plaza FOLDER OUT.csv

The published rows name their beacon in a column, and the place comes from another file. FOLDER: holds plaza1_ranges.csv.gz and
plaza1_reference.csv.gz.
"""

import argparse
import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

BEACONS = (0, 1, 5, 6)


def _columns(file: Path) -> NDArray[np.float64]:
    return np.loadtxt(file, delimiter=",", skiprows=1)


def write_table(folder: Path, out: Path) -> None:
    """Write the table; a distance stands in the column of its beacon, and the other columns of its row are empty."""
    place, ranges = _columns(folder / "plaza1_reference.csv.gz"), _columns(folder / "plaza1_ranges.csv.gz")
    x, y = (np.interp(ranges[:, 0], place[:, 0], place[:, k]) for k in (1, 2))
    with out.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["time [s]", "x [m]", "y [m]", *(f"distance to beacon {n} [m]" for n in BEACONS)])
        for row, east, north in zip(ranges, x, y, strict=True):
            cells = [f"{row[4]:.9g}" if n == row[1] else "" for n in BEACONS]
            table.writerow([f"{row[0]:.9g}", f"{east:.9g}", f"{north:.9g}", *cells])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    chosen = parser.parse_args()
    write_table(chosen.folder, chosen.out)


if __name__ == "__main__":
    main()
