"""Contact detection: the place at which a recorded machine drove into something, as a first guess of a pile's position."""

from typing import Final

import numpy as np
from scipy.signal import savgol_filter

from discrepancy.models.loader.segments import row_ranges
from discrepancy.models.loader.warm_up import ROLLING_RADIUS, dead_reckoning, equilibrium
from discrepancy.signals.recording import Array
from plant.effects import find_effect
from plant.physics.equilibrium import NoEquilibriumError
from plant.physics.kinematics import place_loader
from plant.physics.parameters import GRAVITY_VALUE
from plant.replay import M_BRAKING, M_SPEED, M_TORQUE
from plant.sheets.machine import Machine

CONTACT: Final = 0.12  # resistance as a share of the weight; rolling resistance and steep roads stay below it
ONSET: Final = 0.03  # rise above the second before, as a share of the weight, at which contact begins
LASTING_S: Final = 0.15  # shortest contact
SMOOTH_S: Final = 0.2  # half the width of the filter that differentiates speed
BRAKED_S: Final = 0.5  # until released brakes have let go
FORWARD: Final = 0.05  # wheel speed [rad/s]


def contact_position(
    machine: Machine, payload: float, measured: Array, step_s: float, yaw_rate: Array | None = None
) -> float | None:
    """Position of the bucket's edge [m] along the x axis of the first row, at the onset of the strongest contact; None without contact.

    measured: (n, MEASURED) of a whole recording; yaw_rate: of the rear frame (n,) [rad/s], if it was measured.
    """
    resistance = _resistance(machine, payload, measured, step_s)
    second, shortest = round(1.0 / step_s), round(LASTING_S / step_s)
    weight = GRAVITY_VALUE * (machine.mass + payload)
    contacts = [rows for rows in row_ranges(resistance > CONTACT * weight) if len(rows) >= shortest]
    if not contacts:
        return None
    first = max(contacts, key=lambda rows: float(np.max(resistance[rows]))).start
    before = resistance[max(first - second, 0) : first]
    base = float(np.median(before)) if before.size else 0.0
    onset = first
    # back from the strong contact to its beginning: the bucket's edge met the pile where the resistance began to rise
    while onset > 0 and resistance[onset - 1] > base + ONSET * weight:
        onset -= 1
    along, _, heading = dead_reckoning(machine, measured, step_s, yaw_rate)[onset]
    try:
        x, y = _edge(machine, payload, measured[onset])
    except NoEquilibriumError:
        return None
    return float(along + np.cos(heading) * x - np.sin(heading) * y)


def _resistance(machine: Machine, payload: float, measured: Array, step_s: float) -> Array:
    """Force of the wheels' torque that does not accelerate the machine [N] (n,), while it drives ahead without brakes; else 0."""
    radius = ROLLING_RADIUS * machine.tyre.radius
    width = 2 * round(SMOOTH_S / step_s) + 1
    if len(measured) < width:
        return np.zeros(len(measured))
    acceleration = savgol_filter(radius * measured[:, M_SPEED], width, 2, deriv=1, delta=step_s)
    thrust = np.sum(measured[:, M_TORQUE : M_TORQUE + 4], axis=1) / radius
    # brakes hold on for a moment after the pedal is released: the convolution extends every braking by BRAKED_S
    braked = (
        np.convolve(measured[:, M_BRAKING] > 0.0, np.ones(round(BRAKED_S / step_s)))[: len(measured)] > 0.0
    )
    ahead = (measured[:, M_SPEED] > FORWARD) & ~braked
    return np.where(ahead, thrust - (machine.mass + payload) * acceleration, 0.0)


def _edge(machine: Machine, payload: float, row: Array) -> tuple[float, float]:
    """Position of the bucket's cutting edge in the rear frame's axes, from the joint [m]: ahead and left. Raises NoEquilibriumError."""
    state, p, work, *_ = equilibrium(machine, payload, row).inside()
    place_loader(state, p, work.tree, work.places)
    pile = find_effect("pile_entry").typical().named
    pin, bucket = work.places.points[3], work.places.axes[4]
    edge = pin + pile["edge_x_m"] * bucket[:, 0] + pile["edge_z_m"] * bucket[:, 2]
    return float(edge[0]), float(edge[1])
