"""Readings of force transducers in the wheel hubs: the force of the ground minus weight and inertia of the wheel.

Thesis 3.2: SWIFT transducers between hub and rim, 426 kg of wheel outside of them (table 3; 4.19 kN in appendix A, E-33).
"""

import numpy as np

from ecu.estimators.parameters import GRAVITY
from plant.sheets.machine import Machine
from plant.unit.unit import TICK_S
from studies.thesis.drive import Array, Truths


def hub_reading(truth: Truths, machine: Machine) -> Array:
    """Vertical force on each hub (n, 4) [N]: N - m_w (g + a), on level ground.

    a: upward acceleration of the wheel's centre, from the tyre's deflection, over 30 ms.
    """
    falling = np.gradient(np.gradient(truth["tyre_deflection"], TICK_S, axis=0), TICK_S, axis=0)
    return np.asarray(truth["normal_force"] - machine.wheel.mass * (GRAVITY - falling), np.float64)


def with_tare(reading: Array, machine: Machine) -> Array:
    """Readings with the wheel's standing weight added, as the thesis does for its tyre loads; the wheel's inertia stays out."""
    return reading + machine.wheel.mass * GRAVITY
