"""The recording of a small car under motion capture, as TU Delft's DART writes it: rows of 100 Hz, slow sensors repeated in them."""

import csv
import io
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from diagnosis.reading.tables import unpacked
from identify.reading import BadRecording

Array = NDArray[np.float64]

COLUMNS = ("vicon time", "vicon x", "vicon y", "vicon yaw", "steering", "W (IMU)", "vel encoder")


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """Geometry and mass. Distances from the rear axle, forwards."""

    wheelbase: float = 0.1735  # [m]
    centre: float = 0.093  # of mass [m]
    marker: float = 0.115  # reference point of the motion capture [m]
    mass: float = 1.58  # [kg]
    inertia: float = 1.58 * 0.093 * 0.0805  # about the vertical [kg m²]: as if all mass sat on both axles


@dataclass(frozen=True, slots=True, kw_only=True)
class CarLog:
    """One drive. All (n,), SI; sensors hold their last value between their own readings."""

    name: str
    time: Array
    x: Array
    y: Array
    yaw: Array
    steering: Array  # command, -1 to 1
    gyro: Array
    encoder: Array


def read_car(path: Path) -> CarLog:
    """A CSV file, compressed or not. Raises BadRecording."""
    try:
        raw = path.read_bytes()
        if path.suffix == ".gz":
            raw, cut = unpacked(raw, path.name)
            if cut:
                raise BadRecording(f"{path}: {cut[0]}")
        rows = list(csv.reader(io.StringIO(raw.decode("utf-8"), newline="")))
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise BadRecording(f"{path}: cannot be read: {error}") from error
    if len(rows) < 3:
        raise BadRecording(f"{path}: has no rows below its heading")
    missing = [name for name in COLUMNS if name not in rows[0]]
    if missing:
        raise BadRecording(f"{path}: has no column '{missing[0]}'; it has {', '.join(rows[0])}")
    at = [rows[0].index(name) for name in COLUMNS]
    try:
        table = np.array([[float(row[i]) for i in at] for row in rows[1:]])
    except (ValueError, IndexError) as error:
        raise BadRecording(f"{path}: a cell is no number or missing: {error}") from error
    ascending = np.concatenate(([True], np.diff(np.maximum.accumulate(table[:, 0])) > 0.0))
    time, x, y, yaw, steering, gyro, encoder = table[ascending].T
    return CarLog(
        name=path.name,
        time=time - time[0],
        x=x,
        y=y,
        yaw=np.unwrap(yaw),
        steering=steering,
        gyro=gyro,
        encoder=encoder,
    )
