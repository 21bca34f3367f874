"""A tyre of the plant on a driven cylinder: the longitudinal force that a rig would measure, from the plant's own law."""

import numpy as np
from numpy.typing import NDArray

from identify.compiled import compiled
from plant.physics.parameters import (
    P_WHEELS,
    W_CARCASS_DAMPING,
    W_LONGITUDINAL_STIFFNESS,
    W_PCX1,
    W_SHORTEST_RELAXATION,
    WHEEL_SIZE,
    change_pressure,
    parameter_vector,
)
from plant.physics.surface import Surface
from plant.physics.tyre import (
    combined_forces,
    curvatures,
    magic_formula,
    magic_slope,
    relax,
    stiffness_and_peak,
)
from plant.sheets.machine import Machine

Array = NDArray[np.float64]


def wheel_block(machine: Machine, pressure_bar: float) -> Array:
    """The plant's parameters of a front tyre at a pressure, on the surface of its nominal friction.

    Without the damping that the plant adds to a carcass below walking speed, which keeps a standing machine from ringing.
    """
    p = parameter_vector(machine, Surface(friction=machine.tyre.nominal_friction), 0.0)
    w = np.array(p[P_WHEELS : P_WHEELS + WHEEL_SIZE])
    change_pressure(w, machine.tyre, pressure_bar - machine.tyre.front_pressure)
    w[W_CARCASS_DAMPING] = 0.0
    return w


@compiled
def steady_force(w: Array, friction: float, load: float, kappa: Array) -> Array:
    """Force of settled slip [N], shape of kappa (n,); friction: over the nominal one."""
    stiffness, _, peak, _ = stiffness_and_peak(w, friction, load)
    out = np.empty(kappa.size)
    for i in range(kappa.size):
        curvature, _ = curvatures(w, load, kappa[i])
        out[i] = magic_formula(kappa[i], stiffness, w[W_PCX1], peak, curvature)
    return out


@compiled
def _rate(w: Array, load: float, curve: Array, kappa: float, speed: float, sliding: float) -> float:
    curvature, _ = curvatures(w, load, kappa)
    length = magic_slope(kappa, curve[0], w[W_PCX1], curve[1], curvature) / w[W_LONGITUDINAL_STIFFNESS]
    return relax(kappa, speed, sliding, max(length, w[W_SHORTEST_RELAXATION]), 0.0)


@compiled
def drum_force(
    w: Array, friction: float, load: Array, speed: Array, wheel: Array, step: float
) -> tuple[Array, Array]:
    """Force (n,) [N] and transient slip (n,) under a rolling wheel, by Runge-Kutta steps of fourth order.

    load, speed of the road, speed of the wheel's circumference: (n,) on an even grid of `step` [s]; starts settled.
    """
    n = speed.size
    force, slip = np.empty(n), np.empty(n)
    kappa = (wheel[0] - speed[0]) / max(abs(speed[0]), 1e-3)
    curve = np.empty(2)
    for k in range(n):
        normal = max(load[k], 1.0)
        curve[0], _, curve[1], _ = stiffness_and_peak(w, friction, normal)
        curvature, _ = curvatures(w, normal, kappa)
        force[k] = magic_formula(kappa, curve[0], w[W_PCX1], curve[1], curvature)
        slip[k] = kappa
        if k + 1 == n:
            break
        v0, v1 = abs(speed[k]), abs(speed[k + 1])
        s0, s1 = speed[k] - wheel[k], speed[k + 1] - wheel[k + 1]
        vm, sm = 0.5 * (v0 + v1), 0.5 * (s0 + s1)
        a = _rate(w, normal, curve, kappa, v0, s0)
        b = _rate(w, normal, curve, kappa + 0.5 * step * a, vm, sm)
        c = _rate(w, normal, curve, kappa + 0.5 * step * b, vm, sm)
        d = _rate(w, normal, curve, kappa + step * c, v1, s1)
        kappa += step * (a + 2.0 * b + 2.0 * c + d) / 6.0
    return force, slip


@compiled
def at_slip_angle(
    w: Array, friction: float, load: Array, kappa: Array, tan_alpha: Array
) -> tuple[Array, Array]:
    """Longitudinal and lateral force (n,) [N] of a wheel at transient slips kappa (n,) whose slip angles (n,) have settled."""
    along, across = np.empty(kappa.size), np.empty(kappa.size)
    for k in range(kappa.size):
        normal = max(load[k], 1.0)
        along[k], across[k], _ = combined_forces(
            w, normal, stiffness_and_peak(w, friction, normal), kappa[k], tan_alpha[k]
        )
    return along, across
