"""The brush model with a parabolic pressure, pure longitudinal slip: force, derivatives and fit.

Source: Pacejka, chapter 3; thesis (26)-(32). It holds for slips above -1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from discrepancy.estimation.normal_equations import inverse

Array = NDArray[np.float64]


def brush_force(
    kappa: Array, load: Array | float, friction: float, slip_stiffness: float
) -> tuple[Array, Array, Array]:
    """Force (n,) [N] and its derivatives by the friction and by the slip stiffness [N]."""
    if np.any(kappa <= -1.0):
        raise ValueError(
            "the brush model holds for slips above -1: a wheel that is locked or turns backwards is outside"
        )
    sigma = kappa / (1.0 + kappa)
    limit = friction * np.asarray(load, float)
    # z: the sliding share of the contact length; by_z and the chain rule give both derivatives
    z = np.minimum(slip_stiffness * np.abs(sigma) / (3.0 * limit), 1.0)  # 1 where all of the contact slides
    sign = np.sign(sigma)
    force = sign * limit * (3.0 * z - 3.0 * z**2 + z**3)
    by_z = sign * limit * 3.0 * (1.0 - z) ** 2
    by_friction = force / friction - by_z * z / friction
    return force, by_friction, by_z * z / slip_stiffness


def _normal(jacobian: object) -> Array:
    J = np.asarray(jacobian, float)
    return np.asarray(J.T @ J, float)


@dataclass(frozen=True, slots=True, kw_only=True)
class Brush:
    """A fitted brush: estimates, standard deviations, root mean square of the residual [N]."""

    friction: float
    slip_stiffness: float
    friction_sd: float
    slip_stiffness_sd: float
    rms: float


def fit_brush(
    kappa: Array,
    force: Array,
    load: Array | float,
    *,
    friction: float | None = None,
    bounds: tuple[tuple[float, float], tuple[float, float]] = ((0.01, 2.0), (1.0, 1e7)),
) -> Brush:
    """Least squares over friction and slip stiffness; friction: held at this value, as on gravel in the thesis (122)."""
    (low_f, high_f), (low_c, high_c) = bounds
    mean = float(np.mean(load))
    free = friction is None

    def unpack(x: Array) -> tuple[float, float]:
        return (float(x[0]), float(x[1]) * mean) if free else (float(friction or 0.0), float(x[0]) * mean)

    def residual(x: Array) -> Array:
        return brush_force(kappa, load, *unpack(x))[0] - force

    def jacobian(x: Array) -> Array:
        _, f, c = brush_force(kappa, load, *unpack(x))
        return np.stack([f, c * mean], axis=1) if free else (c * mean)[:, None]

    edges = ([low_f, low_c / mean], [high_f, high_c / mean]) if free else ([low_c / mean], [high_c / mean])
    start = [min(max(0.7, low_f * 1.01), high_f * 0.99), 8.0] if free else [8.0]
    found = least_squares(residual, start, jacobian, bounds=edges)
    dof = max(kappa.size - len(start), 1)
    sd = np.sqrt(np.diag(inverse(_normal(found.jac))) * 2.0 * found.cost / dof)
    mu, stiffness = unpack(found.x)
    return Brush(
        friction=mu,
        slip_stiffness=stiffness,
        friction_sd=float(sd[0]) if free else 0.0,
        slip_stiffness_sd=float(sd[-1]) * mean,
        rms=float(np.sqrt(2.0 * found.cost / kappa.size)),
    )
