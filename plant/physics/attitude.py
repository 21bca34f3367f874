"""Attitudes as unit quaternions (w, x, y, z), for the starts of the plant; a step of the plant turns its own.

Few lines instead of scipy's rotations, whose package takes a fifth of a second to load in every process; a test compares them.
Source: M. D. Shuster, A survey of attitude representations, J. Astronautical Sciences 41 (1993).
"""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Quaternion = tuple[float, float, float, float]

SLIGHT = 1e-3
"""Angle [rad] up to which the sine of its half over it is taken from its series, as 0/0 has no value."""


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """The turn q followed by the turn p, both about axes of the world; of length one."""
    return unit(*_times(p, q))


def of_angles(yaw: float, pitch: float, roll: float) -> Quaternion:
    """Turned by yaw about z, then by pitch about its own y, then by roll about its own x [rad]."""
    turned = (math.cos(yaw / 2.0), 0.0, 0.0, math.sin(yaw / 2.0))
    turned = _times(turned, (math.cos(pitch / 2.0), 0.0, math.sin(pitch / 2.0), 0.0))
    return _times(turned, (math.cos(roll / 2.0), math.sin(roll / 2.0), 0.0, 0.0))


def of_turn(vector: Array) -> Quaternion:
    """Turned about the direction of `vector` by its length [rad]."""
    x, y, z = vector.tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    square = angle * angle
    share = (
        0.5 - square / 48.0 + square * square / 3840.0 if angle <= SLIGHT else math.sin(angle / 2.0) / angle
    )
    return math.cos(angle / 2.0), share * x, share * y, share * z


def of_axes(axes: Array) -> Quaternion:
    """The attitude whose axes, orthogonal and right-handed, are the columns of (3, 3) `axes`."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = axes.tolist()
    trace = xx + yy + zz
    # by the largest of the four, so that nothing is divided by nearly zero
    largest = max(trace, xx, yy, zz)
    if largest == trace:
        return unit(1.0 + trace, zy - yz, xz - zx, yx - xy)
    if largest == xx:
        return unit(zy - yz, 1.0 - trace + 2.0 * xx, yx + xy, zx + xz)
    if largest == yy:
        return unit(xz - zx, yx + xy, 1.0 - trace + 2.0 * yy, zy + yz)
    return unit(yx - xy, zx + xz, zy + yz, 1.0 - trace + 2.0 * zz)


def _times(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton's product."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + qw * px + (py * qz - pz * qy),
        pw * qy + qw * py + (pz * qx - px * qz),
        pw * qz + qw * pz + (px * qy - py * qx),
    )


def unit(w: float, x: float, y: float, z: float) -> Quaternion:
    """The same attitude, of length one."""
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return w / length, x / length, y / length, z / length
