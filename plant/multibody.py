"""Rigid bodies in a tree: articulated-body algorithm with free and driven joints.

Spatial vectors are (angular, linear), inertias 6 x 6, all in one set of axes about one origin, so
that what belongs to a child simply adds to its parent. A free joint takes an effort and gives an
acceleration; a driven joint takes an acceleration and gives the effort it needs. The acceleration
of the root comes without gravity (true minus gravitational): what an accelerometer reads.
Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 2, 7 and 9 (hybrid dynamics).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plant.compiled import compiled
from plant.state import BODIES, PARENTS

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
    about: Array  # (3, 3): scratch, inertia of the body being placed
    centre: Array  # (6,): scratch, its centre; then a momentum


def new_tree() -> Tree:
    """An empty workspace."""
    n = BODIES
    shapes = ((n, 6, 6), (n, 6), (n, 6), (n, 6), (n, 6), (n, 6), (n,), (n,), (n,), (n, 6), (n,), (n,), (3, 3), (6,))
    return Tree(*(np.zeros(shape) for shape in shapes))


@compiled
def place_body(tree: Tree, body: int, block: Array, origin: Array, axes: Array) -> None:
    """Inertia of a body about the common origin from its block, the origin of its axes and the axes.

    block: mass, centre (3), inertia about the centre xx, yy, zz, xy, xz, yz, in the body's axes;
    origin: where these axes start [m]; axes: (3, 3), their unit vectors as columns.
    """
    m = block[0]
    centre, about = tree.centre, tree.about
    for i in range(3):
        centre[i] = origin[i] + axes[i, 0] * block[1] + axes[i, 1] * block[2] + axes[i, 2] * block[3]
    for i in range(3):
        a, b, c = axes[i, 0], axes[i, 1], axes[i, 2]
        ta = block[4] * a + block[7] * b + block[8] * c
        tb = block[7] * a + block[5] * b + block[9] * c
        tc = block[8] * a + block[9] * b + block[6] * c
        for j in range(3):
            about[i, j] = ta * axes[j, 0] + tb * axes[j, 1] + tc * axes[j, 2]
    shift_inertia(tree, body, m, centre, about)


@compiled
def place_wheel(
    tree: Tree, body: int, m: float, spin: float, transverse: float, centre: Array, axle: Array
) -> None:
    """Inertia of a body that is symmetric about its axle, whatever its spin angle."""
    about = tree.about
    for i in range(3):
        for j in range(3):
            about[i, j] = (spin - transverse) * axle[i] * axle[j]
        about[i, i] += transverse
    shift_inertia(tree, body, m, centre, about)


@compiled
def shift_inertia(tree: Tree, body: int, m: float, centre: Array, about: Array) -> None:
    """Spatial inertia about the origin from mass, centre and inertia about the centre."""
    x, y, z = centre[0], centre[1], centre[2]
    square = x * x + y * y + z * z
    inertia = tree.inertia[body]
    for i in range(3):
        for j in range(3):
            inertia[i, j] = about[i, j] - m * centre[i] * centre[j]
            inertia[i, j + 3] = 0.0
            inertia[i + 3, j + 3] = 0.0
        inertia[i, i] += m * square
        inertia[i + 3, i + 3] = m
    inertia[0, 4], inertia[0, 5], inertia[1, 5] = -m * z, m * y, -m * x
    inertia[1, 3], inertia[2, 3], inertia[2, 4] = m * z, -m * y, m * x
    for i in range(3):
        for j in range(3):
            inertia[j + 3, i] = inertia[i, j + 3]


@compiled
def turn_about(tree: Tree, body: int, direction: Array, point: Array) -> None:
    """Unit motion of a revolute joint about the line through `point` along `direction`."""
    s = tree.axis[body]
    s[0], s[1], s[2] = direction[0], direction[1], direction[2]
    s[3] = point[1] * direction[2] - point[2] * direction[1]
    s[4] = point[2] * direction[0] - point[0] * direction[2]
    s[5] = point[0] * direction[1] - point[1] * direction[0]


@compiled
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


@compiled
def gyroscopic_bias(tree: Tree, body: int) -> None:
    """Bias of one body without outside forces: rate of its momentum at constant velocity, v x* (I v)."""
    inertia, v, p = tree.inertia[body], tree.motion[body], tree.bias[body]
    h = tree.centre
    for i in range(6):
        h[i] = 0.0
    for j in range(6):  # symmetric: row by row, so that the compiler can use vector instructions
        for i in range(6):
            h[i] += inertia[j, i] * v[j]
    p[0] = v[1] * h[2] - v[2] * h[1] + v[4] * h[5] - v[5] * h[4]
    p[1] = v[2] * h[0] - v[0] * h[2] + v[5] * h[3] - v[3] * h[5]
    p[2] = v[0] * h[1] - v[1] * h[0] + v[3] * h[4] - v[4] * h[3]
    p[3] = v[1] * h[5] - v[2] * h[4]
    p[4] = v[2] * h[3] - v[0] * h[5]
    p[5] = v[0] * h[4] - v[1] * h[3]


@compiled
def solve_tree(tree: Tree) -> None:
    """Accelerations of all bodies and free joints, efforts of the driven ones.

    Inertia and bias of the workspace are overwritten by their articulated-body values.
    """
    reach, stiff, rest = tree.reach, tree.stiff, tree.rest
    for body in range(BODIES - 1, 0, -1):
        inertia, p, s, c = tree.inertia[body], tree.bias[body], tree.axis[body], tree.drift[body]
        u = reach[body]
        for i in range(6):
            u[i] = 0.0
        for j in range(6):
            for i in range(6):
                u[i] += inertia[j, i] * s[j]
        d, along = 0.0, 0.0
        for i in range(6):
            d += s[i] * u[i]
            along += s[i] * p[i]
        stiff[body] = d
        rest[body] = tree.effort[body] - along
        upper, upper_bias = tree.inertia[PARENTS[body]], tree.bias[PARENTS[body]]
        for i in range(6):
            upper_bias[i] += p[i]
        for j in range(6):
            for i in range(6):
                upper_bias[i] += inertia[j, i] * c[j]
                upper[j, i] += inertia[j, i]
        if tree.driven[body] > 0.0:
            share = tree.joint_acceleration[body]
        else:  # the joint gives way along its axis
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


@compiled
def solve_root(tree: Tree) -> None:
    """Acceleration of the free root by a Cholesky factorisation of its articulated inertia."""
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
