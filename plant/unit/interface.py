"""Vectors of what is sent at one tick, in the order of the rows of `plant.unit.signals`, for the machine as a unit on the bus."""

from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from plant.truth import Truth
from plant.unit.sensors import Floats, Readings
from plant.unit.signals import CHANNELS, COMPUTED, INDEX, INTERNALS, REFERENCES, STATES, Moment

MACHINE_SOURCES = (*CHANNELS, *STATES, *(row.name for row in INTERNALS))
"""Names of the machine's values: readings, states, and what it knows without a sensor."""

REFERENCE_SOURCES = tuple(row.name for row in (*REFERENCES, *COMPUTED))
"""Names of the test instrumentation's values."""

_STATES = slice(len(CHANNELS), len(CHANNELS) + len(STATES))
_STATE_CHANNELS = tuple([INDEX[name] for name in names] for names in STATES.values())
_INTERNAL_VALUES = attrgetter(*(row.value for row in INTERNALS))
_REFERENCE_PLACES = np.array([row.part.at + row.component for row in REFERENCES])
_COMPUTED_PLACES = [np.array([part.at + component for part, component in row.parts]) for row in COMPUTED]


def machine_values(readings: Readings, moment: Moment) -> Floats:
    """Everything the machine sends, SI, in the order of MACHINE_SOURCES."""
    values = np.zeros(len(MACHINE_SOURCES))
    values[: _STATES.start] = readings.values
    # Sensors are healthy in nearly every tick, and zero is the state of a healthy one.
    # counted, because `any` takes five times as long for so few numbers
    if np.count_nonzero(readings.health):
        values[_STATES] = [readings.health[channels].max() for channels in _STATE_CHANNELS]
    values[_STATES.stop :] = _INTERNAL_VALUES(moment)
    return values


def reference_values(truths: Sequence[Truth]) -> Floats:
    """Everything the test instrumentation sends, SI, a row for each truth, in the order of REFERENCE_SOURCES."""
    rows = np.array([truth.row for truth in truths])
    values = np.empty((len(rows), len(REFERENCE_SOURCES)))
    values[:, : len(REFERENCES)] = rows[:, _REFERENCE_PLACES]
    for k, (row, places) in enumerate(zip(COMPUTED, _COMPUTED_PLACES, strict=True), len(REFERENCES)):
        # math's functions, because numpy's round some last bits otherwise
        values[:, k] = list(map(row.value, *rows[:, places].T.tolist()))
    return values
