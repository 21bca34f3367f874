"""The interface for authors of models: one import for the description, sensor faults, recordings and equations.

    from discrepancy.model import Effect, Model, Parameter, sensor_effects

The functions of `discrepancy.examine` and the settings of a search are for programs that run the engine, not for models.
"""

from discrepancy.model.description import (
    Clock,
    Effect,
    Manoeuvre,
    Model,
    Parameter,
    Port,
    Simulate,
    Window,
)
from discrepancy.model.equations import Signals, Term, with_effect
from discrepancy.model.operators import play
from discrepancy.model.sensors import delayed, device_delay, lagged, misalignment, sensor_effects
from discrepancy.signals.recording import Array, Recording, Signal, changes_only, signal

__all__ = [
    "Array",
    "Clock",
    "Effect",
    "Manoeuvre",
    "Model",
    "Parameter",
    "Port",
    "Recording",
    "Signal",
    "Signals",
    "Simulate",
    "Term",
    "Window",
    "changes_only",
    "delayed",
    "device_delay",
    "lagged",
    "misalignment",
    "play",
    "sensor_effects",
    "signal",
    "with_effect",
]
