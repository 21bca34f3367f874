"""Levelled sensors: by how much accelerations lead an inclination sensor astray (plant.unit.sensors)."""

import math
from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from discrepancy.models.loader.channels import CHANNELS, LEVELLED
from discrepancy.signals.recording import Array


def apart(columns: Mapping[str, Array]) -> Array:
    """What the accelerometers of each levelled channel take for its quantity, less the quantity (n, LEVELLED); columns: of plant.truth."""
    found = []
    for name, (quantity, index) in LEVELLED.items():
        own, component = CHANNELS[name].columns
        true = columns[own] if component is None else columns[own][:, component]
        found.append(columns[quantity][:, index] - true)
    return np.stack(found, axis=1)


def lean(apart: Array, first: float, time_s: float, step_s: float) -> Array:
    """Low-pass of what a sensor's accelerometers feel, `first` at the first row; time_s: its levelling, infinity: it does not lean."""
    if not math.isfinite(time_s):
        return np.zeros_like(apart)
    kept = math.exp(-step_s / time_s) if time_s > 0.0 else 0.0
    gained = 1.0 - kept
    found, _ = lfilter(
        np.array([gained]), np.array([1.0, -kept]), apart, zi=np.array([first - gained * apart[0]])
    )
    return np.asarray(found, float)
