"""From the world to the wheel: ground map (100), rotation (102)-(109), effective radius (112), both slips (110), (111)."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import griddata

Array = NDArray[np.float64]

SLOWEST = 0.5  # speed [m/s] below which a slip is all noise


def ground_height(ground: Array, x: Array, y: Array) -> Array:
    """Height of the ground (n,) [m] under points: interpolated between its measured points (k, 3); beyond them by the parabola through those."""
    if ground.shape[0] < 6:
        raise ValueError(f"{ground.shape[0]} points make no map of the ground; at least 6 are needed")
    inside = griddata(ground[:, :2], ground[:, 2], (x, y), method="linear")
    powers = [(i, j) for i in range(3) for j in range(3 - i)]
    rows = np.stack([ground[:, 0] ** i * ground[:, 1] ** j for i, j in powers], axis=1)
    coefficients = np.linalg.lstsq(rows, ground[:, 2], rcond=None)[0]
    parabola = np.stack([x**i * y**j for i, j in powers], axis=1) @ coefficients
    return np.where(np.isfinite(inside), inside, parabola)


def rotated(a: Array, b: Array, angle: Array) -> tuple[Array, Array]:
    """Components (n,) of a vector of the world in axes that are turned by an angle (102)-(109)."""
    c, s = np.cos(angle), np.sin(angle)
    return c * a + s * b, -s * a + c * b


def effective_radius(loaded: Array, unloaded: float) -> Array:
    """3 r/(1 + 2 r/r_f) (112) [m]: between the loaded and the unloaded radius."""
    return 3.0 * loaded / (1.0 + 2.0 * loaded / unloaded)


def slip(speed: Array, turning: Array, radius: Array) -> Array:
    """-(V_x - r_e Omega)/|V_x| (n,), NaN where the wheel hardly moves. turning: [rad/s]; (110) with that of the markers, (111) with the encoder's."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.abs(speed) > SLOWEST, -(speed - radius * turning) / np.abs(speed), np.nan)
