"""Where a machine drove into something: a first guess of what no other signal places."""

from typing import Final

import numpy as np
from scipy.signal import savgol_filter

from discrepancy.models.pilot import ROLLED, at_begin, reckoned
from discrepancy.models.stretches import runs_of
from discrepancy.recording import Array
from plant.effects import find_effect
from plant.equilibrium import NoEquilibriumError
from plant.follow import M_BRAKING, M_SPEED, M_TORQUE
from plant.kinematics import place_loader
from plant.machine import Machine
from plant.parameters import GRAVITY_VALUE

HEAVY: Final = 0.12  # of its weight: what resists more is no road, and no tyre
LIGHT: Final = 0.03  # beyond the second before, from which on it is being met
LASTING_S: Final = 0.15
SMOOTH_S: Final = 0.2
BRAKED_S: Final = 0.5  # until brakes have let go
FORWARD: Final = 0.05  # wheel speed [rad/s]


def met_at(
    machine: Machine, payload: float, measured: Array, step_s: float, turning: Array | None = None
) -> float | None:
    """Where the bucket's edge was [m], along the first row's x axis, when something began to resist most; None where nothing resisted.

    measured: (n, MEASURED) of a whole recording; turning: yaw rate of the rear frame (n,) [rad/s], if it was measured.
    """
    resisting = _resistance(machine, payload, measured, step_s)
    second, least = round(1.0 / step_s), round(LASTING_S / step_s)
    weight = GRAVITY_VALUE * (machine.mass + payload)
    runs = [run for run in runs_of(resisting > HEAVY * weight) if len(run) >= least]
    if not runs:
        return None
    first = max(runs, key=lambda run: float(np.max(resisting[run]))).start
    before = resisting[max(first - second, 0) : first]
    base = float(np.median(before)) if before.size else 0.0
    begun = first
    while begun > 0 and resisting[begun - 1] > base + LIGHT * weight:
        begun -= 1
    along, _, heading = reckoned(machine, measured, step_s, turning)[begun]
    try:
        x, y = _edge(machine, payload, measured[begun])
    except NoEquilibriumError:
        return None
    return float(along + np.cos(heading) * x - np.sin(heading) * y)


def _resistance(machine: Machine, payload: float, measured: Array, step_s: float) -> Array:
    """What the torque of the wheels does beyond moving the machine [N] (n,), while it drives ahead without brakes; else 0."""
    radius = ROLLED * machine.tyre.radius
    width = 2 * round(SMOOTH_S / step_s) + 1
    if len(measured) < width:
        return np.zeros(len(measured))
    gaining = savgol_filter(radius * measured[:, M_SPEED], width, 2, deriv=1, delta=step_s)
    pushing = np.sum(measured[:, M_TORQUE : M_TORQUE + 4], axis=1) / radius
    braked = (
        np.convolve(measured[:, M_BRAKING] > 0.0, np.ones(round(BRAKED_S / step_s)))[: len(measured)] > 0.0
    )
    ahead = (measured[:, M_SPEED] > FORWARD) & ~braked
    return np.where(ahead, pushing - (machine.mass + payload) * gaining, 0.0)


def _edge(machine: Machine, payload: float, row: Array) -> tuple[float, float]:
    """Where the bucket's cutting edge is in the rear frame's axes, from the joint [m]: ahead and to the left. Raises NoEquilibriumError."""
    state, p, work, *_ = at_begin(machine, payload, row).inside()
    place_loader(state, p, work.tree, work.places)
    pile = find_effect("pile_entry").typical().named
    pin, bucket = work.places.points[3], work.places.axes[4]
    edge = pin + pile["edge_x_m"] * bucket[:, 0] + pile["edge_z_m"] * bucket[:, 2]
    return float(edge[0]), float(edge[1])
