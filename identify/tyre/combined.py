"""Combined slip: the share of the longitudinal force that remains at a slip angle, with its derivatives.

G = cos(C atan(B s - E (B s - atan(B s)))), B = RBX1 cos(atan(RBX2 kappa)), C = RCX1, E = REX1, s = tan(alpha): the form of MF-Tyre 5.2 without shift,
so that G = 1 in pure slip (E-05). Written again beside the plant's, so that a fit to a recording of the plant tests both.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def weight(
    kappa: Array, tan_alpha: Array, rbx1: float, rbx2: float, rcx1: float, rex1: float
) -> tuple[Array, dict[str, Array]]:
    """G (n,), 1 in pure longitudinal slip, and its derivatives (n,) by the coefficients, by "kappa" and by "tan_alpha"."""
    narrowing = 1.0 + (rbx2 * kappa) ** 2
    steepness = rbx1 / np.sqrt(narrowing)
    x = steepness * tan_alpha
    a = np.arctan(x)
    g = x - rex1 * (x - a)
    bend = np.arctan(g)
    sine = np.sin(rcx1 * bend)
    by_g = -rcx1 * sine / (1.0 + g * g)
    by_x = by_g * (1.0 - rex1 + rex1 / (1.0 + x * x))
    return np.cos(rcx1 * bend), {
        "RBX1": by_x * x / rbx1,
        "RBX2": -by_x * x * rbx2 * kappa**2 / narrowing,
        "RCX1": -bend * sine,
        "REX1": -by_g * (x - a),
        "kappa": -by_x * x * rbx2**2 * kappa / narrowing,
        "tan_alpha": by_x * steepness,
    }
