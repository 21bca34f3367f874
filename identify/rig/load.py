"""Load on the wheel from the pressure of the rig's piston, with the uncertainty of its calibration.

The loaded radius was read at some pressures, and the tyre's vertical stiffness (118) converts the readings to loads. A line through
them gives the load at every pressure. The readings have independent errors, the stiffness one common error: the errors of the line are
correlated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identify.rig.log import PistonCalibration
from identify.tyre.parameters import Nominal

Array = NDArray[np.float64]

PER = 1e5  # [Pa]: the line is per bar, so that both coefficients have similar size


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadLine:
    """Load [N] = line[0] + line[1] times the pressure [bar]."""

    line: Array  # (2,)
    root: Array  # (2, 2): times its transpose the line's covariance
    residual: Array  # of the readings' loads (m,) [N]
    excess: float  # spread of the residual over the one expected from the readings

    def load(self, piston_pressure: float) -> float:
        """At a pressure of the piston [Pa]."""
        return float(self.line @ self.row(piston_pressure))

    def row(self, piston_pressure: float) -> Array:
        """Derivative of the load by the line (2,)."""
        return np.array([1.0, piston_pressure / PER])

    def sd(self, piston_pressure: float) -> float:
        """Standard deviation of the load at a pressure [N]."""
        return float(np.linalg.norm(self.row(piston_pressure) @ self.root))


def load_line(calibration: PistonCalibration, nominal: Nominal) -> LoadLine:
    """The line of least squares with its covariance. Raises ValueError where the readings make none."""
    c, n = calibration, calibration.piston_pressure.size
    if n < 2 or np.ptp(c.piston_pressure) <= 0.0:
        raise ValueError(
            f"{n} readings of the piston's calibration at one pressure make no line; at least two pressures are needed"
        )
    depth = 1.0 - c.loaded_radius / nominal.radius
    if np.any(depth <= 0.0):
        raise ValueError(
            f"a loaded radius of {float(np.max(c.loaded_radius)):.3f} m is not below the unloaded one of {nominal.radius:.3f} m: "
            "was the radius or the diameter read?"
        )
    loads = nominal.load * (c.q1 * depth + c.q2 * depth**2)
    by_radius = nominal.load * (c.q1 + 2.0 * c.q2 * depth) / nominal.radius
    rows = np.stack([np.ones(n), c.piston_pressure / PER], axis=1)
    weight = 1.0 / by_radius
    back = np.linalg.pinv(rows * weight[:, None]) * weight
    line = back @ loads
    if line[1] <= 0.0:
        raise ValueError(
            f"the load falls with the piston's pressure ({line[1]:.0f} N/bar): are the columns of the calibration exchanged?"
        )
    own = back * (by_radius * c.radius_sd)
    covariance = own @ own.T + np.outer(line, line) * c.stiffness_sd**2
    residual = loads - rows @ line
    excess = (
        float(np.sqrt(np.sum((residual / (by_radius * c.radius_sd)) ** 2) / max(n - 2, 1)))
        if c.radius_sd > 0.0
        else 0.0
    )
    root = np.asarray(np.linalg.cholesky(covariance + np.eye(2) * 1e-12 * float(np.max(line**2))), float)
    return LoadLine(line=line, root=root, residual=residual, excess=excess)
