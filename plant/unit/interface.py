"""Vectors of what is sent at one tick, in the order of the rows of `plant.unit.signals`, for the machine as a unit on the bus."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bus.machine_code import direct
from plant.compiled import uncounted
from plant.truth import Truth
from plant.unit.sensors import Floats, Readings
from plant.unit.signals import CHANNELS, COMPUTED, INTERNALS, OWN, REFERENCES, SENSORS, STATES

MACHINE_SOURCES = (*CHANNELS, *STATES, *(row.name for row in INTERNALS))
"""Names of the machine's values: readings, states, and what it knows without a sensor."""

REFERENCE_SOURCES = tuple(row.name for row in (*REFERENCES, *COMPUTED))
"""Names of the test instrumentation's values."""

_STATE_PLACES = np.array(
    [MACHINE_SOURCES.index(channel.state) if channel.state else -1 for channel in SENSORS], np.int64
)
_OWN_PLACES = np.array([row.place for row in INTERNALS], np.int64)
_REFERENCE_PLACES = np.array([row.part.at + row.component for row in REFERENCES])
_COMPUTED_PLACES = [np.array([part.at + component for part, component in row.parts]) for row in COMPUTED]


class MachineValues:
    """Everything the machine sends, SI, in the order of MACHINE_SOURCES: a vector that is filled anew at every tick."""

    def __init__(self) -> None:
        self._vector = np.zeros(len(MACHINE_SOURCES))
        places = (_STATE_PLACES, _OWN_PLACES)
        health = np.zeros(len(CHANNELS), np.int64)
        self._fill = direct(
            fill_values, self._vector, np.zeros(len(CHANNELS)), health, np.zeros(OWN), *places
        )

    def of(self, readings: Readings, own: Floats) -> Floats:
        """At one tick; own: by the places of `signals`."""
        self._fill(self._vector, readings.values, readings.health, own, _STATE_PLACES, _OWN_PLACES)
        return self._vector


@uncounted
def fill_values(
    values: Floats,
    readings: Floats,
    health: NDArray[np.int64],
    own: Floats,
    state_places: NDArray[np.int64],
    own_places: NDArray[np.int64],
) -> None:
    """Readings, then the states of the sensors, then what the machine knows of itself; a state of several channels is the worst of them."""
    channels, first = readings.size, values.size - own_places.size
    values[channels:first] = 0.0
    for k in range(channels):
        values[k] = readings[k]
        if state_places[k] >= 0:
            values[state_places[k]] = max(values[state_places[k]], health[k])
    for k in range(own_places.size):
        values[first + k] = own[own_places[k]]


def reference_values(truths: Sequence[Truth]) -> Floats:
    """Everything the test instrumentation sends, SI, a row for each truth, in the order of REFERENCE_SOURCES."""
    rows = np.array([truth.row for truth in truths])
    values = np.empty((len(rows), len(REFERENCE_SOURCES)))
    values[:, : len(REFERENCES)] = rows[:, _REFERENCE_PLACES]
    for k, (row, places) in enumerate(zip(COMPUTED, _COMPUTED_PLACES, strict=True), len(REFERENCES)):
        # math's functions, because numpy's round some last bits otherwise
        values[:, k] = list(map(row.value, *rows[:, places].T.tolist()))
    return values
