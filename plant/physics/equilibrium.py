"""The equilibrium of the machine on its tyres, by Newton's method on the plant's own equations.

For a standing machine all accelerations of the rear frame and of the rear axle vanish while the brakes hold the wheels; tangential forces of
the tyres balance the slope. A machine that will roll is in equilibrium in heave, roll, pitch and oscillation only, because its tangential
forces come from its motion (`plant.physics.rolling`).
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from plant.physics import attitude
from plant.physics import state as s
from plant.physics.dynamics import derivative
from plant.physics.parameters import (
    P_FRICTION,
    P_GRAVITY,
    P_OSCILLATION_X,
    P_WHEELS,
    W_CENTRE,
    W_NOMINAL_LOAD,
    W_QFZ1,
    W_QFZ2,
    W_RADIUS,
    WHEEL_SIZE,
)
from plant.physics.workspace import Workspace

Array = NDArray[np.float64]

STANDING = np.arange(7)
ROLLING = np.array((2, 3, 4, 6))
SLIP_PER_METRE = 3.0  # slip of a standing tyre per metre of displacement [1/m]: only affects the position of the equilibrium
LONGEST = np.array((0.02, 0.02, 0.02, 0.02, 0.02, 0.02, 0.05))  # change of one iteration [m, rad]
ITERATIONS = 100
AT_REST = 1e-9  # [m/s2, rad/s2]


class NoEquilibriumError(ValueError):
    """There is no equilibrium: the machine would tip over or slide."""


def find_equilibrium(
    state: Array,
    p: Array,
    work: Workspace,
    active: Array | None,
    road: Array,
    *,
    heading: float,
    standing: bool,
) -> None:
    """Put `state` (joint angles set, velocities zero) to rest on the road.

    active: the effects that are switched on, or None; road: its axes in the world, (3, 3); heading: of the rear frame about the road's normal [rad].
    Raises NoEquilibriumError.
    """
    command = np.zeros(s.COMMANDS)
    free = STANDING if standing else ROLLING
    rest = np.zeros(7)  # along, across, above [m], turn about x, y, z of the road, oscillation [rad]

    def residual(unknowns: Array) -> Array:
        _place(state, unknowns, road, heading, p)
        derivative(state, command, p, 0.0, work, active)
        return accelerations(work, road, p)

    # Newton's method needs a start with all wheels on the road, where the tyres' stiffness is not zero.
    rest[2] = _resting_height(residual, p, work)
    rest += _over_the_ground(work.ground[:, s.G_HEIGHT], p)
    if not solved(residual, rest, free):
        raise NoEquilibriumError(
            "the machine has no equilibrium: it would tip over or slide "
            f"(road slope {math.degrees(math.acos(road[2, 2])):.1f} deg, friction scale {p[P_FRICTION]:.2f}); "
            "payload, slope or articulation is too large, or friction too small"
        )


def accelerations(work: Workspace, road: Array, p: Array) -> Array:
    """The machine's accelerations at the last evaluation, (7,): rear frame along, across and above the road, about these axes, oscillation."""
    rise = work.tree.acceleration[s.REAR_FRAME]
    axes = work.places.world.T @ road
    linear = axes.T @ rise[3:] - p[P_GRAVITY] * road[2]
    return np.concatenate(
        (linear, axes.T @ rise[:3], work.tree.joint_acceleration[s.REAR_AXLE : s.REAR_AXLE + 1])
    )


def solved(residual: Callable[[Array], Array], unknowns: Array, free: NDArray[np.intp]) -> bool:
    """Solve for the `free` unknowns in place, by Newton's method, until their residuals vanish; returns whether it succeeded."""
    error = residual(unknowns)[free]
    for _ in range(ITERATIONS):
        if np.max(np.abs(error)) < AT_REST:
            return True
        try:
            change = np.asarray(np.linalg.solve(_slopes(residual, unknowns, free), error), np.float64)
        except np.linalg.LinAlgError:
            return False
        change /= max(1.0, float(np.max(np.abs(change) / LONGEST[free])))
        unknowns[:], error = _best_part(residual, unknowns, change, free, error)
    return False


def _resting_height(residual: Callable[[Array], Array], p: Array, work: Workspace) -> float:
    """Height of the joint when every wheel carries a quarter of the weight, on the front tyres' spring."""
    residual(np.zeros(7))
    w = p[P_WHEELS : P_WHEELS + WHEEL_SIZE]
    load = work.whole[0] * p[P_GRAVITY] / 4.0 / w[W_NOMINAL_LOAD]
    share = 2.0 * load / (w[W_QFZ1] + math.sqrt(w[W_QFZ1] ** 2 + 4.0 * w[W_QFZ2] * load))
    return float(w[W_RADIUS] * (1.0 - share) - w[W_CENTRE + 2])


def _over_the_ground(heights: Array, p: Array) -> Array:
    """Change of the unknowns that puts the machine as it stands on heights under its four wheels [m]."""
    front, rear = P_WHEELS + W_CENTRE, P_WHEELS + 2 * WHEEL_SIZE + W_CENTRE
    ahead, behind = heights[:2].mean(), heights[2:].mean()
    roll = (heights[0] - heights[1]) / (2.0 * p[front + 1])
    oscillation = (heights[2] - heights[3]) / (2.0 * p[rear + 1]) - roll
    pitch = (behind - ahead) / (p[front] - p[P_OSCILLATION_X])
    return np.array((0.0, 0.0, 0.5 * (ahead + behind), roll, pitch, 0.0, oscillation))


def _best_part(
    residual: Callable[[Array], Array], at: Array, change: Array, free: NDArray[np.intp], error: Array
) -> tuple[Array, Array]:
    """The unknowns after the first of the full, half, quarter... steps that reduces the residual; in a longer one wheels may leave the road."""
    for part in 0.5 ** np.arange(12):
        trial = at.copy()
        trial[free] -= part * change
        left = residual(trial)[free]
        if np.linalg.norm(left) < np.linalg.norm(error):
            break
    return trial, left


def _slopes(residual: Callable[[Array], Array], at: Array, free: NDArray[np.intp]) -> Array:
    """Derivative of the residual by central differences over 1e-7 m or rad."""
    columns = []
    for index in free:
        ahead, behind = at.copy(), at.copy()
        ahead[index] += 1e-7
        behind[index] -= 1e-7
        columns.append((residual(ahead)[free] - residual(behind)[free]) / 2e-7)
    return np.column_stack(columns)


def _place(state: Array, unknowns: Array, road: Array, heading: float, p: Array) -> None:
    """Write pose and standing slips into the state."""
    along, across, above, roll, pitch, yaw, oscillation = unknowns
    state[s.POSITION : s.POSITION + 3] = above * road[:, 2]
    on_road = attitude.of_angles(heading, float(pitch), float(roll))
    state[s.ATTITUDE : s.ATTITUDE + 4] = attitude.product(attitude.of_axes(road), on_road)
    state[s.JOINT + s.REAR_AXLE] = oscillation
    for wheel in range(4):
        w = P_WHEELS + wheel * WHEEL_SIZE + W_CENTRE
        angle, start = (state[s.JOINT + s.FRONT_FRAME], 0.0) if wheel < 2 else (0.0, p[P_OSCILLATION_X])
        c, sn = math.cos(angle), math.sin(angle)
        x, y = start + c * p[w] - sn * p[w + 1], sn * p[w] + c * p[w + 1]
        moved_x, moved_y = along - yaw * y, across + yaw * x
        state[s.KAPPA + wheel] = -SLIP_PER_METRE * (c * moved_x + sn * moved_y)
        state[s.TAN_ALPHA + wheel] = -SLIP_PER_METRE * (c * moved_y - sn * moved_x)
