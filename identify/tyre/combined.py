"""Combined slip: how much of the longitudinal force is left beside a slip angle, and the fit of its weight.

G = cos(C atan(B s)), B = RBX1 cos(atan(RBX2 kappa)), s = tan(alpha): the form of MF-Tyre 5.2 without curvature and shift, so that G = 1 in pure slip (E-05).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from discrepancy.estimation.normal_equations import inverse

Array = NDArray[np.float64]

NAMES = ("RBX1", "RBX2", "RCX1")


def weight(kappa: Array, tan_alpha: Array, rbx1: float, rbx2: float, rcx1: float) -> Array:
    """G (n,), 1 in pure longitudinal slip."""
    steepness = rbx1 / np.sqrt(1.0 + (rbx2 * kappa) ** 2)
    return np.cos(rcx1 * np.arctan(steepness * tan_alpha))


def _normal(jacobian: object) -> Array:
    J = np.asarray(jacobian, float)
    return np.asarray(J.T @ J, float)


@dataclass(frozen=True, slots=True, kw_only=True)
class CombinedSlip:
    """Coefficients (3,) in the order of NAMES and their standard deviations; undetermined: those that the data tell nothing of."""

    value: Array
    sd: Array
    undetermined: tuple[str, ...]


def fit_weight(kappa: Array, tan_alpha: Array, force: Array, pure: Array) -> CombinedSlip:
    """From forces (n,) at combined slip and what the tyre has at the same slip without an angle (n,)."""

    def residual(x: Array) -> Array:
        return pure * weight(kappa, tan_alpha, *x.tolist()) - force

    found = least_squares(
        residual,
        [10.0, 10.0, 0.95],
        bounds=([0.1, 0.0, 0.1], [100.0, 100.0, 1.0]),
        x_scale=[1.0, 1.0, 0.1],
        jac="3-point",
    )
    variance = 2.0 * found.cost / max(kappa.size - 3, 1)
    sd = np.sqrt(np.diag(inverse(_normal(found.jac))) * variance)
    # an angle that removes less of the force than the residual's spread tells nothing
    open_ = tuple(
        name
        for name, s, scale in zip(NAMES, sd, (10.0, 10.0, 1.0), strict=True)
        if s == 0.0 or s > 0.5 * scale
    )
    return CombinedSlip(value=found.x, sd=sd, undetermined=open_)
