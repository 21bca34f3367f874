"""Contact patch and vertical stiffness of a tyre, (116) to (118): linear in their coefficients, fitted by least squares."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identify.tyre.parameters import Nominal

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Linear:
    """Coefficients of a linear law, their standard deviations, and the root mean square of the residual in the unit of the data."""

    names: tuple[str, str]
    value: Array  # (2,)
    sd: Array  # (2,)
    rms: float


def half_length(length: Sequence[float] | Array, load: Sequence[float] | Array, nominal: Nominal) -> Linear:
    """(116) from patch lengths A (n,) [m]: half of A over R0 is q_a1 sqrt(F_z/F_zo) + q_a2 F_z/F_zo."""
    share = np.asarray(load, float) / nominal.load
    return _fit(("qa1", "qa2"), [np.sqrt(share), share], 0.5 * np.asarray(length, float), nominal.radius)


def half_width(width: Sequence[float] | Array, load: Sequence[float] | Array, nominal: Nominal) -> Linear:
    """(117) from patch widths B (n,) [m]: half of B over R0 is q_b1 cbrt(F_z/F_zo) + q_b2 F_z/F_zo."""
    share = np.asarray(load, float) / nominal.load
    return _fit(("qb1", "qb2"), [np.cbrt(share), share], 0.5 * np.asarray(width, float), nominal.radius)


def radial_stiffness(
    deflection: Sequence[float] | Array, load: Sequence[float] | Array, nominal: Nominal
) -> Linear:
    """(118) from deflections (n,) [m]: F_z over F_zo is q_Fz1 rho/R0 + q_Fz2 (rho/R0)^2."""
    depth = np.asarray(deflection, float) / nominal.radius
    return _fit(("qfz1", "qfz2"), [depth, depth**2], np.asarray(load, float), nominal.load)


def _fit(names: tuple[str, str], columns: Sequence[Array], value: Array, unit: float) -> Linear:
    rows = np.stack(columns, axis=1)
    if rows.shape[0] < 3 or np.linalg.matrix_rank(rows) < 2:
        raise ValueError(
            f"{rows.shape[0]} readings do not determine {names[0]} and {names[1]}: at least three at different loads are needed"
        )
    found, _, _, _ = np.linalg.lstsq(rows, value / unit, rcond=None)
    residual = value / unit - rows @ found
    variance = float(residual @ residual) / (rows.shape[0] - 2)
    sd = np.sqrt(variance * np.diag(np.linalg.inv(rows.T @ rows)))
    return Linear(
        names=names,
        value=np.asarray(found, float),
        sd=np.asarray(sd, float),
        rms=float(np.sqrt(np.mean(residual**2))) * unit,
    )
