"""Single readings of inputs that jump far beyond all others: a glitch of an encoder, a bit that fell over.

An output that jumps is set aside when nothing explains it. An input is taken as it is: the model drives on it, and everything after the glitch is compared
with a motion that did not happen.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from discrepancy.model.description import Model
from discrepancy.signals.quantities import quantity
from discrepancy.signals.recording import Complaint, Recording, Signal, cleaned

NEIGHBOURS: Final = 5  # samples whose median a reading is compared with
BEYOND: Final = 10.0  # times the distance that all but one in a hundred keep
MOST: Final = (
    0.01  # share of the samples of which nearly all are usual; more readings of a kind are how the signal is
)
FEWEST: Final = 100  # samples, below which one in a hundred is none
SHOWN: Final = 4  # times of them in the complaint


def spikes(model: Model, recording: Recording) -> Iterator[Complaint]:
    """A complaint on each input that has them; the input is used all the same."""
    clean, _ = cleaned(recording)
    for name in [name for name in model.inputs if name in clean.signals]:
        signal = clean.signals[name]
        if (at := _jumping(signal)).size:
            times = ", ".join(f"{signal.time_s[i]:.6g}" for i in at[:SHOWN])
            more = f" and {at.size - SHOWN} more" if at.size > SHOWN else ""
            others = np.delete(signal.value, at)
            low, high, first = (
                quantity(float(x), signal.unit) for x in (others.min(), others.max(), signal.value[at[0]])
            )
            text = (
                f"jumps for a single reading at {times} s{more}, first to {first}; all other readings keep from {low} to {high}. "
                "An input is used as it was recorded: correct these readings, or what follows them is judged wrongly"
            )
            yield Complaint(recording.name, name, text, fatal=False)


def _jumping(signal: Signal) -> NDArray[np.intp]:
    """Indices of readings that leave the range of all others and come back at once."""
    x = signal.value
    if x.size < FEWEST:
        return np.zeros(0, np.intp)
    away = np.abs(x - median_filter(x, NEIGHBOURS, mode="nearest"))
    low, high = np.quantile(x, [MOST, 1.0 - MOST])
    # beyond what the signal does at its most lively, and further than its whole range is wide; a signal that stands still has no range
    far = max(BEYOND * float(np.quantile(away, 1.0 - MOST)), float(high - low))
    return np.flatnonzero(away > far) if high > low else np.zeros(0, np.intp)
