"""When readings are taken and commands given: on the model's grid, between its points, or at irregular times, as on a bus.

Stamps are exact: a reading is what the sensor saw at its stamp, and a command acts from its stamp on.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

# and how a page says it
KINDS: Final = {"beside": "between the grid's points", "irregular": "at irregular times"}
FIRST = 0.4  # of a period, at which the first reading beside the grid is taken
LONGER = 0.1  # share by which a period beside the grid is longer: later stamps drift over the grid
SCATTER = 0.3  # of a period, by which an irregular one is shorter or longer at most


def rows(count: int, every: int, kind: str, rng: np.random.Generator) -> NDArray[np.intp]:
    """Of `count` steps of the truth, those that are read, about one of `every`; kind: of KINDS, or empty for exactly one of `every`."""
    if kind == "beside":
        return np.arange(round(FIRST * every), count, every + max(1, round(LONGER * every)))
    if kind == "irregular":
        least, most = (round((1.0 + side * SCATTER) * every) for side in (-1.0, 1.0))
        found = np.cumsum(rng.integers(least, most + 1, size=count // least + 1))
        return np.asarray(found[found < count], np.intp)
    return np.arange(0, count, every)
