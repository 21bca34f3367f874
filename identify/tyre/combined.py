"""Combined slip: the share of the longitudinal force that remains at a slip angle, and the fit of this weight.

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
    """A fitted weight."""

    value: Array  # coefficients (3,) in the order of NAMES
    sd: Array  # (3,)
    undetermined: tuple[str, ...]  # names of coefficients that the data do not determine


def fit_weight(kappa: Array, tan_alpha: Array, force: Array, pure: Array) -> CombinedSlip:
    """The weight that fits forces (n,) [N] at combined slip; pure: forces at the same slip without a slip angle (n,) [N]."""

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
    # a slip angle that changes the force by less than the scatter of the residual contains no information
    open_ = tuple(
        name
        for name, s, scale in zip(NAMES, sd, (10.0, 10.0, 1.0), strict=True)
        if s == 0.0 or s > 0.5 * scale
    )
    return CombinedSlip(value=found.x, sd=sd, undetermined=open_)
