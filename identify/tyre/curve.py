"""The Magic Formula as a curve of seven numbers, with all first derivatives of its force and of its slope.

The plant has a tyre of its own (plant/physics/tyre.py). This one is written again from the source, so that a fit to a recording
made by the plant tests both. Derivatives are analytic (forward mode, one direction at a time): the transient model needs
those of the slope too, because its relaxation length follows the slope.
Source: Pacejka, Tire and Vehicle Dynamics, chapter 4; thesis (11)-(24).
"""

import math

import numpy as np
from numpy.typing import NDArray

from identify.compiled import compiled

Array = NDArray[np.float64]

CURVE = (
    "stiffness",
    "shape",
    "peak",
    "curvature driving",
    "curvature braking",
    "shift of slip",
    "shift of force",
)
"""K [N], C, D [N], E for positive and for negative slip, S_H, S_V [N]: what load and pressure make of a tyre's parameters."""

K, C, D, E_DRIVE, E_BRAKE, S_H, S_V = range(7)
SMALL = 1e-9  # keeps B = K/(C D) finite


@compiled
def force_and_slope(curve: Array, kappa: float, force: Array, slope: Array) -> tuple[float, float]:
    """Force [N] and slope dF/dkappa [N] at a slip; derivatives by the curve's numbers into `force` and `slope`, shape (7,).

    The derivative by kappa itself is that by S_H. E beyond 1 counts as 1, as a curve without a peak would follow.
    """
    x = kappa + curve[S_H]
    stiffness, shape, peak = curve[K], curve[C], curve[D]
    branch = E_DRIVE if x >= 0.0 else E_BRAKE
    clipped = curve[branch] > 1.0
    curvature = 1.0 if clipped else curve[branch]
    steepness = stiffness / (shape * peak + SMALL)
    u = steepness * x
    a = math.atan(u)
    w = 1.0 / (1.0 + u * u)
    g = u - curvature * (u - a)
    g_u = 1.0 - curvature * (1.0 - w)
    bend = math.atan(g)
    q = 1.0 / (1.0 + g * g)
    s, c = math.sin(shape * bend), math.cos(shape * bend)
    for i in range(7):
        force[i] = slope[i] = 0.0
    for i in range(6):
        du = dc = de = dk = dd = 0.0
        if i == K:
            du, dk = u / stiffness, 1.0
        elif i == C:
            du, dc = -u / shape, 1.0
        elif i == D:
            du, dd = -u / peak, 1.0
        elif i == S_H:
            du = steepness
        elif i == branch and not clipped:
            de = 1.0
        else:
            continue
        dg = g_u * du - (u - a) * de
        dh = shape * q * dg + bend * dc
        dg_u = -(1.0 - w) * de - 2.0 * curvature * u * w * w * du
        dq = -2.0 * g * q * q * dg
        force[i] = dd * s + peak * c * dh
        slope[i] = dk * c * q * g_u + stiffness * (-s * dh * q * g_u + c * dq * g_u + c * q * dg_u)
    force[S_V] = 1.0
    return peak * s + curve[S_V], stiffness * c * q * g_u


@compiled
def steady(curves: Array, kappa: Array, force: Array, by_curve: Array) -> None:
    """Forces (n,) and their derivatives by each sample's own curve (n, 7); curves: (n, 7)."""
    slope = np.empty(7)
    for i in range(kappa.size):
        force[i], _ = force_and_slope(curves[i], kappa[i], by_curve[i], slope)
