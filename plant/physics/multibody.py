"""Rigid bodies in a tree: articulated-body algorithm with free and driven joints.

Spatial vectors are (angular, linear), inertias 6 x 6, all in one set of axes about one origin, so that inertias and forces of a child are
simply added to those of its parent. For a free joint the effort is given and the acceleration results; for a driven joint the acceleration is
given and the required effort results. The acceleration of the root excludes gravity (true minus gravitational), as an accelerometer reads.
Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 2, 7 and 9 (hybrid dynamics).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plant.compiled import uncounted
from plant.physics.state import BODIES, PARENTS

Array = NDArray[np.float64]


class Tree(NamedTuple):
    """Workspace of one evaluation; row b belongs to body b and the joint that carries it."""

    inertia: Array  # (bodies, 6, 6)
    bias: Array  # (bodies, 6): force that the velocities alone need, minus what acts from outside
    axis: Array  # (bodies, 6): unit motion of the joint
    drift: Array  # (bodies, 6): acceleration from velocities alone
    motion: Array  # (bodies, 6): spatial velocity
    acceleration: Array  # (bodies, 6): spatial acceleration minus gravity
    driven: Array  # (bodies,): 1 where the joint's acceleration is prescribed
    joint_acceleration: Array  # (bodies,): given where driven, result elsewhere
    effort: Array  # (bodies,): result where driven, given elsewhere
    reach: Array  # (bodies, 6): scratch of the solver, inertia times axis
    stiff: Array  # (bodies,): scratch, inertia along the axis
    rest: Array  # (bodies,): scratch, effort left after the bias


def new_tree() -> Tree:
    """An empty workspace."""
    n = BODIES
    shapes = ((n, 6, 6), (n, 6), (n, 6), (n, 6), (n, 6), (n, 6), (n,), (n,), (n,), (n, 6), (n,), (n,))
    return Tree(*(np.zeros(shape) for shape in shapes))


@uncounted
def turned(block: Array, row: Array, column: Array) -> float:
    """One element of the inertia about the centre after turning: row R, element R I R^T column."""
    a, b, c = column[0], column[1], column[2]
    along = row[0] * (block[4] * a + block[7] * b + block[8] * c)
    along += row[1] * (block[7] * a + block[5] * b + block[9] * c)
    return along + row[2] * (block[8] * a + block[9] * b + block[6] * c)


@uncounted
def place_body(tree: Tree, body: int, block: Array, origin: Array, axes: Array) -> None:
    """Inertia of a body about the common origin from its block, the origin of its axes and the axes.

    block: mass, centre (3), inertia about the centre xx, yy, zz, xy, xz, yz, in the body's axes;
    origin: where these axes start [m]; axes: (3, 3), their unit vectors as columns.
    """
    rx, ry, rz = axes[0], axes[1], axes[2]
    x = origin[0] + rx[0] * block[1] + rx[1] * block[2] + rx[2] * block[3]
    y = origin[1] + ry[0] * block[1] + ry[1] * block[2] + ry[2] * block[3]
    z = origin[2] + rz[0] * block[1] + rz[1] * block[2] + rz[2] * block[3]
    xx, yy, zz = turned(block, rx, rx), turned(block, ry, ry), turned(block, rz, rz)
    xy, xz, yz = turned(block, rx, ry), turned(block, rx, rz), turned(block, ry, rz)
    set_inertia(tree.inertia[body], block[0], x, y, z, xx, yy, zz, xy, xz, yz)


@uncounted
def place_wheel(
    tree: Tree, body: int, m: float, spin: float, transverse: float, centre: Array, axle: Array
) -> None:
    """Inertia of a body that is symmetric about its axle, whatever its spin angle."""
    more = spin - transverse
    a, b, c = axle[0], axle[1], axle[2]
    xx, yy, zz = transverse + more * a * a, transverse + more * b * b, transverse + more * c * c
    xy, xz, yz = more * a * b, more * a * c, more * b * c
    set_inertia(tree.inertia[body], m, centre[0], centre[1], centre[2], xx, yy, zz, xy, xz, yz)


@uncounted
def set_inertia(
    inertia: Array,
    m: float,
    x: float,
    y: float,
    z: float,
    xx: float,
    yy: float,
    zz: float,
    xy: float,
    xz: float,
    yz: float,
) -> None:
    """Spatial inertia about the origin from mass, centre (x, y, z) and inertia about the centre."""
    mx, my, mz = m * x, m * y, m * z
    inertia[0, 0], inertia[1, 1], inertia[2, 2] = (
        xx + my * y + mz * z,
        yy + mx * x + mz * z,
        zz + mx * x + my * y,
    )
    inertia[0, 1] = inertia[1, 0] = xy - mx * y
    inertia[0, 2] = inertia[2, 0] = xz - mx * z
    inertia[1, 2] = inertia[2, 1] = yz - my * z
    inertia[0, 3] = inertia[1, 4] = inertia[2, 5] = inertia[3, 0] = inertia[4, 1] = inertia[5, 2] = 0.0
    inertia[0, 4] = inertia[4, 0] = -mz
    inertia[0, 5] = inertia[5, 0] = my
    inertia[1, 3] = inertia[3, 1] = mz
    inertia[1, 5] = inertia[5, 1] = -mx
    inertia[2, 3] = inertia[3, 2] = -my
    inertia[2, 4] = inertia[4, 2] = mx
    inertia[3, 3] = inertia[4, 4] = inertia[5, 5] = m
    inertia[3, 4] = inertia[3, 5] = inertia[4, 3] = inertia[4, 5] = inertia[5, 3] = inertia[5, 4] = 0.0


@uncounted
def turn_about(tree: Tree, body: int, direction: Array, point: Array) -> None:
    """Unit motion of a revolute joint about the line through `point` along `direction`."""
    s = tree.axis[body]
    s[0], s[1], s[2] = direction[0], direction[1], direction[2]
    s[3] = point[1] * direction[2] - point[2] * direction[1]
    s[4] = point[2] * direction[0] - point[0] * direction[2]
    s[5] = point[0] * direction[1] - point[1] * direction[0]


@uncounted
def carry_motion(tree: Tree, body: int, rate: float) -> None:
    """Velocity of a body and its drift from the parent's velocity and the joint's rate."""
    parent = tree.motion[PARENTS[body]]
    s, v, c = tree.axis[body], tree.motion[body], tree.drift[body]
    for i in range(6):
        v[i] = parent[i] + s[i] * rate
    c[0] = (parent[1] * s[2] - parent[2] * s[1]) * rate
    c[1] = (parent[2] * s[0] - parent[0] * s[2]) * rate
    c[2] = (parent[0] * s[1] - parent[1] * s[0]) * rate
    c[3] = (parent[1] * s[5] - parent[2] * s[4] + parent[4] * s[2] - parent[5] * s[1]) * rate
    c[4] = (parent[2] * s[3] - parent[0] * s[5] + parent[5] * s[0] - parent[3] * s[2]) * rate
    c[5] = (parent[0] * s[4] - parent[1] * s[3] + parent[3] * s[1] - parent[4] * s[0]) * rate


@uncounted
def gyroscopic_bias(tree: Tree, body: int) -> None:
    """Bias of one body without outside forces: rate of its momentum at constant velocity, v x* (I v)."""
    inertia, p, motion = tree.inertia[body], tree.bias[body], tree.motion[body]
    a, b, c, x, y, z = motion[0], motion[1], motion[2], motion[3], motion[4], motion[5]
    m, mx, my, mz = inertia[5, 5], inertia[2, 4], inertia[0, 5], inertia[1, 3]
    # momentum: angular about the origin, linear
    ha = inertia[0, 0] * a + inertia[0, 1] * b + inertia[0, 2] * c + my * z - mz * y
    hb = inertia[1, 0] * a + inertia[1, 1] * b + inertia[1, 2] * c + mz * x - mx * z
    hc = inertia[2, 0] * a + inertia[2, 1] * b + inertia[2, 2] * c + mx * y - my * x
    hx, hy, hz = m * x + b * mz - c * my, m * y + c * mx - a * mz, m * z + a * my - b * mx
    p[0] = b * hc - c * hb + y * hz - z * hy
    p[1] = c * ha - a * hc + z * hx - x * hz
    p[2] = a * hb - b * ha + x * hy - y * hx
    p[3], p[4], p[5] = b * hz - c * hy, c * hx - a * hz, a * hy - b * hx


@uncounted
def solve_tree(tree: Tree) -> None:
    """Accelerations of all bodies and free joints, efforts of the driven ones.

    Inertia and bias of the workspace are overwritten by their articulated-body values.
    """
    reach, stiff, rest = tree.reach, tree.stiff, tree.rest
    for body in range(BODIES - 1, 0, -1):
        inertia, p, s, c = tree.inertia[body], tree.bias[body], tree.axis[body], tree.drift[body]
        u = reach[body]
        d, along = 0.0, 0.0
        for i in range(6):
            total = 0.0
            for j in range(6):
                total += inertia[i, j] * s[j]
            u[i] = total
            d += s[i] * total
            along += s[i] * p[i]
        stiff[body] = d
        rest[body] = tree.effort[body] - along
        upper, upper_bias = tree.inertia[PARENTS[body]], tree.bias[PARENTS[body]]
        for i in range(6):
            total = p[i]
            for j in range(6):
                total += inertia[i, j] * c[j]
                upper[i, j] += inertia[i, j]
            upper_bias[i] += total
        # A driven joint passes the whole inertia of its child on to the parent. A free joint does not resist along its axis: that direction
        # is subtracted (rank-one update), and its effort and drift act on the parent as a force.
        if tree.driven[body] > 0.0:
            share = tree.joint_acceleration[body]
        else:
            along_drift = 0.0
            for i in range(6):
                along_drift += u[i] * c[i]
            share = (rest[body] - along_drift) / d
            for j in range(6):
                scaled = u[j] / d
                for i in range(6):
                    upper[j, i] -= scaled * u[i]
        for i in range(6):
            upper_bias[i] += u[i] * share
    solve_root(tree)
    for body in range(1, BODIES):
        parent, a = tree.acceleration[PARENTS[body]], tree.acceleration[body]
        s, c, u = tree.axis[body], tree.drift[body], reach[body]
        along = 0.0
        for i in range(6):
            a[i] = parent[i] + c[i]
            along += u[i] * a[i]
        if tree.driven[body] > 0.0:
            qdd = tree.joint_acceleration[body]
            tree.effort[body] = stiff[body] * qdd + along + tree.effort[body] - rest[body]
        else:
            qdd = (rest[body] - along) / stiff[body]
            tree.joint_acceleration[body] = qdd
        for i in range(6):
            a[i] += s[i] * qdd


@uncounted
def solve_root(tree: Tree) -> None:
    """Acceleration of the free root by a Cholesky factorisation of its articulated inertia."""
    # By hand, for 6 x 6: np.linalg would allocate, and its overhead exceeds the arithmetic at this size.
    factor, a = tree.inertia[0], tree.acceleration[0]
    for j in range(6):
        for k in range(j):
            for i in range(j, 6):
                factor[i, j] -= factor[i, k] * factor[j, k]
        scale = 1.0 / math.sqrt(factor[j, j])
        for i in range(j, 6):
            factor[i, j] *= scale
    for i in range(6):
        a[i] = -tree.bias[0, i]
        for k in range(i):
            a[i] -= factor[i, k] * a[k]
        a[i] /= factor[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            a[i] -= factor[k, i] * a[k]
        a[i] /= factor[i, i]
