"""Operators with memory for equations, beside the low-pass of discrepancy.model.sensors."""

import numpy as np

from discrepancy.signals.recording import Array


def play(x: Array, width: float) -> Array:
    """Play (backlash) operator: follows x with a dead zone of +-width; the simplest memory without a time scale."""
    out = np.empty_like(x)
    now = float(x[0])
    for i, value in enumerate(x.tolist()):
        now = min(max(now, value - width), value + width)
        out[i] = now
    return out
