"""Columns of lanes: arrays (n, LANES)."""

import numpy as np
from numpy.typing import NDArray

from bus.lanes.operations import LANES
from plant.compiled import compiled, uncounted

Array = NDArray[np.float64]


@compiled
def repeated(column: Array) -> Array:
    """The same numbers in all lanes, (n, LANES)."""
    out = np.empty((column.size, LANES))
    for lane in range(LANES):
        out[:, lane] = column
    return out


@uncounted
def set_lane(lanes: Array, lane: int, column: Array) -> None:
    """Put numbers into one lane."""
    for i in range(column.size):
        lanes[i, lane] = column[i]


@uncounted
def get_lane(lanes: Array, lane: int, column: Array) -> None:
    """Take the numbers of one lane."""
    for i in range(column.size):
        column[i] = lanes[i, lane]
