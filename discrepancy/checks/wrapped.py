"""Angles that jump by a whole turn: a compass from 0 to 360 degrees, an encoder that starts again.

Between two samples on either side of such a jump nothing turned. A model that lets the angle grow predicts another turn, and everything that goes with the
difference, a sign of the heading say, then seems to explain it.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from discrepancy.model.description import Model
from discrepancy.signals.quantities import figures
from discrepancy.signals.recording import Complaint, Recording, cleaned
from discrepancy.signals.units import parse_unit

TURN: Final = 2.0 * np.pi
NEAR: Final = 0.1  # of a turn, by which a jump may differ from one
SHOWN: Final = 3  # times of them in the complaint


def wrapped(model: Model, recording: Recording) -> Iterator[Complaint]:
    """A complaint on each angle of the model that jumps by a turn in the recording; it is used as it is."""
    clean, _ = cleaned(recording)
    for name, unit in {**model.driving, **model.outputs}.items():
        if name not in clean.signals or parse_unit(unit) != parse_unit("rad"):
            continue
        signal = clean.signals[name]
        at = np.flatnonzero(np.abs(np.abs(np.diff(signal.value)) - TURN) < NEAR * TURN)
        if at.size:
            times = ", ".join(figures(float(signal.time_s[1 + i]), 6) for i in at[:SHOWN])
            more = f" and {at.size - SHOWN} more" if at.size > SHOWN else ""
            text = (
                f"jumps by a whole turn at {times} s{more}: an angle that starts again. Let it grow instead (numpy.unwrap), "
                "unless the model starts again at the same angle"
            )
            yield Complaint(recording.name, name, text, fatal=False)
