"""Steering cylinders: one on each side of the joint, and the pressures of the two lines that feed them.

The line for turning left feeds the right cylinder's head and the left one's rod side, the line for turning right the
others. The line that does not push is at the back pressure. Not modelled: friction, pressure loss, and the elasticity of oil and hoses
(effect steering_compliance).
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant.compiled import uncounted
from plant.sheets.machine import Steering

Array = NDArray[np.float64]

# Layout of what the functions below need of a machine: points from the joint [m], areas [m2], pressure [Pa].
S_REAR: Final = 0  # x, y of the left cylinder's pin on the rear frame
S_FRONT: Final = 2  # x, y of its pin on the front frame
S_HEAD: Final = 4  # area of one cylinder
S_ROD: Final = 5
S_BACK: Final = 6
STEERING: Final = 7


def cylinders_of(steering: Steering) -> Array:
    """The steering cylinders of a machine, (STEERING,)."""
    head = math.pi / 4.0 * steering.bore**2
    return np.array(
        (
            *(steering.rear_pin_x, steering.rear_pin_y, steering.front_pin_x, steering.front_pin_y),
            *(head, head - math.pi / 4.0 * steering.rod**2, steering.back_pressure),
        )
    )


@uncounted
def steering_cylinder(k: Array, angle: float) -> tuple[float, float]:
    """Length of the left cylinder [m] and its moment arm about the joint [m], turning right positive.

    angle: articulation, left positive [rad]. The right cylinder is the left one at the opposite angle.
    """
    c, s = math.cos(angle), math.sin(angle)
    fx, fy = k[S_FRONT] * c - k[S_FRONT + 1] * s, k[S_FRONT] * s + k[S_FRONT + 1] * c
    x, y = fx - k[S_REAR], fy - k[S_REAR + 1]
    length = math.sqrt(x * x + y * y)
    return length, (x * fy - y * fx) / length


@uncounted
def torques_per_pressure(k: Array, angle: float) -> tuple[float, float]:
    """Torque about the joint per pressure in the lines for turning left and right [m³], each positive in its own direction."""
    _, on_left = steering_cylinder(k, angle)
    _, on_right = steering_cylinder(k, -angle)
    return k[S_HEAD] * on_right + k[S_ROD] * on_left, k[S_HEAD] * on_left + k[S_ROD] * on_right


@uncounted
def steering_pressures(k: Array, angle: float, torque: float) -> tuple[float, float]:
    """Pressures of the lines for turning left and right [Pa] for a torque on the front frame [N m], left positive."""
    to_left, to_right = torques_per_pressure(k, angle)
    left = (torque + k[S_BACK] * to_right) / to_left
    if left >= k[S_BACK]:
        return left, k[S_BACK]
    return k[S_BACK], (k[S_BACK] * to_left - torque) / to_right
