"""Operators with memory for equations, beside the low-pass of discrepancy.model.sensors."""

import numpy as np

from discrepancy.signals.recording import Array


def play(x: Array, width: float) -> Array:
    """Play (backlash) operator: follows x with a dead zone of +-width; the simplest memory without a time scale."""
    # Each sample limits the value before it to its own dead zone, and two limits after each other are one again.
    # So the limits from the first sample on double their reach in every pass (a prefix scan), without a loop over samples.
    low, high = x - width, x + width
    reach = 1
    while reach < x.size:
        before_low, before_high = low[:-reach], high[:-reach]
        now_low, now_high = low[reach:], high[reach:]
        low = np.concatenate([low[:reach], np.minimum(np.maximum(before_low, now_low), now_high)])
        high = np.concatenate([high[:reach], np.minimum(np.maximum(before_high, now_low), now_high)])
        reach *= 2
    return np.asarray(np.minimum(np.maximum(x[0], low), high), float)
