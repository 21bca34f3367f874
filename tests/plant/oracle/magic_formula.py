"""The Magic Formula of MF-Tyre 5.2 and 6.1 in plain numpy, straight from the published equations and a file's own names.

Source: Pacejka, Tire and Vehicle Dynamics, 3rd ed., 4.3.2: equations 4.E9 to 4.E18 (longitudinal), 4.E19 to 4.E30 (lateral),
4.E50 to 4.E59 and 4.E61 (combined); no camber, no shifts, all scale factors 1, no turn slip.
"""

from collections.abc import Mapping

import numpy as np


def forces(c: Mapping[str, float], load, kappa, slip, dpi=0.0):
    """Longitudinal and lateral force [N] in combined slip; c: coefficients by name; slip: alpha or its tangent, as the model says."""
    get = {name: c.get(name, 0.0) for name in NAMES}.__getitem__
    dfz = (load - c["FNOMIN"]) / c["FNOMIN"]

    cx = get("PCX1")
    dx = (get("PDX1") + get("PDX2") * dfz) * (1 + get("PPX3") * dpi + get("PPX4") * dpi**2) * load
    ex = (get("PEX1") + get("PEX2") * dfz + get("PEX3") * dfz**2) * (1 - get("PEX4") * np.sign(kappa))
    kx = load * (get("PKX1") + get("PKX2") * dfz) * np.exp(get("PKX3") * dfz)
    kx = kx * (1 + get("PPX1") * dpi + get("PPX2") * dpi**2)
    fx0 = curve(kappa, kx / (cx * dx), cx, dx, np.minimum(ex, 1.0), np.sin)

    cy = get("PCY1")
    dy = np.abs(get("PDY1") + get("PDY2") * dfz) * (1 + get("PPY3") * dpi + get("PPY4") * dpi**2) * load
    ey = np.minimum(get("PEY1") + get("PEY2") * dfz, 1.0)
    most = np.abs(get("PKY1")) * c["FNOMIN"] * (1 + get("PPY1") * dpi)
    ky = most * np.sin(2 * np.arctan(load / (get("PKY2") * (1 + get("PPY2") * dpi) * c["FNOMIN"])))
    fy0 = curve(slip, ky / (cy * dy), cy, dy, ey, np.sin)

    bxa = get("RBX1") * np.cos(np.arctan(get("RBX2") * kappa))
    byk = get("RBY1") * np.cos(np.arctan(get("RBY2") * slip))
    gxa = curve(slip, bxa, get("RCX1"), 1.0, get("REX1"), np.cos)
    gyk = curve(kappa, byk, get("RCY1"), 1.0, 0.0, np.cos)
    return gxa * fx0, gyk * fy0


def curve(x, b, c, d, e, wave):
    """D wave(C atan(Bx - E (Bx - atan Bx)))."""
    bx = b * x
    return d * wave(c * np.arctan(bx - e * (bx - np.arctan(bx))))


NAMES = (
    "PCX1", "PDX1", "PDX2", "PEX1", "PEX2", "PEX3", "PEX4", "PKX1", "PKX2", "PKX3", "PPX1", "PPX2", "PPX3", "PPX4",
    "PCY1", "PDY1", "PDY2", "PEY1", "PEY2", "PKY1", "PKY2", "PPY1", "PPY2", "PPY3", "PPY4", "RBX1", "RBX2", "RCX1", "REX1", "RBY1", "RBY2", "RCY1",
)  # fmt: skip
