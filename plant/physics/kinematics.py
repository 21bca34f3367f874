"""Positions and motion of the loader's bodies, in the axes of the rear frame.

Origin: the articulation joint. Fills the tree's inertias, joint axes, velocities and drifts.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plant.compiled import inlined, uncounted
from plant.physics.multibody import Tree, carry_motion, gyroscopic_bias, place_body, place_wheel, turn_about
from plant.physics.parameters import (
    B_BUCKET,
    B_FRONT_FRAME,
    B_LIFT_ARM,
    B_REAR_AXLE,
    B_REAR_FRAME,
    BODY_SIZE,
    P_ARM_LENGTH,
    P_CARRY_TILT,
    P_LIFT_X,
    P_LIFT_Z,
    P_OSCILLATION_X,
    P_OSCILLATION_Z,
    P_WHEELS,
    W_CENTRE,
    W_MASS,
    W_SPIN,
    W_TRANSVERSE,
    WHEEL_SIZE,
)
from plant.physics.state import (
    ANGULAR,
    ATTITUDE,
    BUCKET,
    FRONT_FRAME,
    JOINT,
    JOINT_RATE,
    LIFT_ARM,
    REAR_AXLE,
    REAR_FRAME,
    VELOCITY,
    WHEEL,
)

Array = NDArray[np.float64]


class Places(NamedTuple):
    """Positions and directions in the axes of the rear frame, from the articulation joint."""

    world: Array  # (3, 3) the world's axes: rotation matrix, world from rear frame
    centres: Array  # (4, 3) wheel centres [m]
    axles: Array  # (4, 3) directions of their axles, to the left
    axes: Array  # (5, 3, 3) of rear frame, front frame, rear axle, arm, bucket, as columns
    points: Array  # (5, 3) joint, oscillation pivot, arm's pivot, bucket's pin; direction of the lift axis


def new_places() -> Places:
    """Places with what never changes: the rear frame's own axes, and the axes of the vertical joint and the pivot."""
    axes = np.zeros((5, 3, 3))
    axes[0] = np.eye(3)
    axes[1, 2, 2] = axes[2, 0, 0] = 1.0
    return Places(np.zeros((3, 3)), np.zeros((4, 3)), np.zeros((4, 3)), axes, np.zeros((5, 3)))


@uncounted
def rotation(state: Array, axes: Array) -> None:
    """Rotation matrix, world from rear frame, into `axes`."""
    w, x, y, z = state[ATTITUDE], state[ATTITUDE + 1], state[ATTITUDE + 2], state[ATTITUDE + 3]
    axes[0, 0], axes[0, 1], axes[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    axes[1, 0], axes[1, 1], axes[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    axes[2, 0], axes[2, 1], axes[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@uncounted
def nose_up(front: Array, angle: float, axes: Array) -> None:
    """Axes of a body pitched nose-up by `angle` against the front frame."""
    c, s = math.cos(angle), math.sin(angle)
    for i in range(3):
        axes[i, 0] = c * front[i, 0] + s * front[i, 2]
        axes[i, 1] = front[i, 1]
        axes[i, 2] = c * front[i, 2] - s * front[i, 0]


@inlined
def place_loader(state: Array, p: Array, tree: Tree, place: Places) -> None:
    """All bodies and joints of the loader at `state`: fills tree and places."""
    world, centres, axles = place.world, place.centres, place.axles
    rotation(state, world)
    rear, front, axle, arm, bucket = place.axes[0], place.axes[1], place.axes[2], place.axes[3], place.axes[4]
    origin, pivot, lift, pin, down = (
        place.points[0],
        place.points[1],
        place.points[2],
        place.points[3],
        place.points[4],
    )
    c, s = math.cos(state[JOINT + FRONT_FRAME]), math.sin(state[JOINT + FRONT_FRAME])
    front[0, 0], front[1, 0], front[0, 1], front[1, 1] = c, s, -s, c
    c, s = math.cos(state[JOINT + REAR_AXLE]), math.sin(state[JOINT + REAR_AXLE])
    axle[1, 1], axle[2, 1], axle[1, 2], axle[2, 2] = c, s, -s, c
    nose_up(front, state[JOINT + LIFT_ARM], arm)
    nose_up(front, state[JOINT + BUCKET] - p[P_CARRY_TILT], bucket)

    pivot[0], pivot[2] = p[P_OSCILLATION_X], p[P_OSCILLATION_Z]
    for i in range(3):
        lift[i] = p[P_LIFT_X] * front[i, 0] + p[P_LIFT_Z] * front[i, 2]
        pin[i] = lift[i] + p[P_ARM_LENGTH] * arm[i, 0]
        down[i] = -front[i, 1]

    place_body(tree, REAR_FRAME, p[B_REAR_FRAME : B_REAR_FRAME + BODY_SIZE], origin, rear)
    place_body(tree, FRONT_FRAME, p[B_FRONT_FRAME : B_FRONT_FRAME + BODY_SIZE], origin, front)
    place_body(tree, REAR_AXLE, p[B_REAR_AXLE : B_REAR_AXLE + BODY_SIZE], pivot, axle)
    place_body(tree, LIFT_ARM, p[B_LIFT_ARM : B_LIFT_ARM + BODY_SIZE], lift, arm)
    place_body(tree, BUCKET, p[B_BUCKET : B_BUCKET + BODY_SIZE], pin, bucket)
    turn_about(tree, FRONT_FRAME, rear[:, 2], origin)
    turn_about(tree, REAR_AXLE, rear[:, 0], pivot)
    turn_about(tree, LIFT_ARM, down, lift)
    turn_about(tree, BUCKET, down, pin)
    for wheel in range(4):
        w = P_WHEELS + wheel * WHEEL_SIZE
        start, carrier = (origin, front) if wheel < 2 else (pivot, axle)
        centre, direction = centres[wheel], axles[wheel]
        for i in range(3):
            direction[i] = carrier[i, 1]
            centre[i] = start[i]
            for j in range(3):
                centre[i] += carrier[i, j] * p[w + W_CENTRE + j]
        place_wheel(tree, WHEEL + wheel, p[w + W_MASS], p[w + W_SPIN], p[w + W_TRANSVERSE], centre, direction)
        turn_about(tree, WHEEL + wheel, direction, centre)

    for i in range(3):
        tree.motion[REAR_FRAME, i] = state[ANGULAR + i]
        tree.motion[REAR_FRAME, 3 + i] = 0.0
        for j in range(3):
            tree.motion[REAR_FRAME, 3 + i] += world[j, i] * state[VELOCITY + j]
    for body in range(1, BUCKET):
        carry_motion(tree, body, state[JOINT_RATE + body])
    carry_motion(tree, BUCKET, state[JOINT_RATE + BUCKET] - state[JOINT_RATE + LIFT_ARM])
    for body in range(BUCKET + 1):
        gyroscopic_bias(tree, body)
