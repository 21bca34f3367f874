"""Relief valves and stroke ends of the cylinders: a driven joint yields if its cylinder would need more than the relief pressure.

Up to the relief pressure a cylinder moves its joint as demanded. Beyond it the cylinder keeps the force of that pressure, and the acceleration
of the joint results. The forces are affine in the accelerations of the three driven joints, so four solutions of the tree determine them
exactly. At the end of its stroke the stop of the cylinder carries any load. The valves are ideal and at the cylinders' ports: no dependence on
flow; the relief valve of the pump is not modelled. Steering that is decoupled from its cylinders (effects steering_compliance, steering_play)
carries the load of their spring and has no valve.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant.compiled import compiled, uncounted
from plant.physics.linkage import (
    K_LIFT_BACK,
    K_LIFT_HEAD,
    K_LIFT_ROD,
    K_TILT_BACK,
    K_TILT_HEAD,
    K_TILT_ROD,
    LINKAGE,
    cylinder_forces,
)
from plant.physics.multibody import Tree, solve_tree
from plant.physics.parameters import (
    P_CYLINDERS,
    P_GUARD,
    P_LIFT,
    P_LINKAGE,
    P_STEERING,
    P_TILT,
    SERVO_LOWER,
    SERVO_RELIEF,
    SERVO_UPPER,
)
from plant.physics.relief_guard import G_COUPLING, G_LIFT, G_STEERING, G_STROKES, G_TILT
from plant.physics.state import BUCKET, FRONT_FRAME, JOINT, LIFT_ARM
from plant.physics.steering import S_BACK, STEERING, torques_per_pressure

Array = NDArray[np.float64]

CYLINDERS: Final = 3  # steering, as a torque [N m]; lift and tilt, as forces [N]


@uncounted
def forces(state: Array, p: Array, tree: Tree) -> tuple[float, float, float]:
    """Torque of the steering cylinders [N m], forces of lift and tilt cylinders [N], extending positive, from the joints' efforts."""
    lift, tilt = cylinder_forces(
        p[P_LINKAGE : P_LINKAGE + LINKAGE],
        state[JOINT + LIFT_ARM],
        state[JOINT + BUCKET],
        tree.effort[LIFT_ARM],
        tree.effort[BUCKET],
    )
    return tree.effort[FRONT_FRAME] if tree.driven[FRONT_FRAME] > 0.0 else 0.0, lift, tilt


@uncounted
def within_stroke(pull: float, push: float, angle: float, block: Array) -> tuple[float, float]:
    """Least and greatest force of a cylinder: of its relief valve, and of its stop where the stroke ends."""
    return (
        -math.inf if angle >= block[SERVO_UPPER] else pull,
        math.inf if angle <= block[SERVO_LOWER] else push,
    )


@uncounted
def steering_bounds(state: Array, p: Array) -> tuple[float, float]:
    """Least and greatest torque of the steering cylinders [N m]."""
    k, angle = p[P_CYLINDERS : P_CYLINDERS + STEERING], state[JOINT + FRONT_FRAME]
    relief = p[P_STEERING + SERVO_RELIEF]
    to_left, to_right = torques_per_pressure(k, angle)
    return within_stroke(
        k[S_BACK] * to_left - relief * to_right,
        relief * to_left - k[S_BACK] * to_right,
        angle,
        p[P_STEERING:],
    )


@uncounted
def lift_bounds(state: Array, p: Array) -> tuple[float, float]:
    """Least and greatest force of the lift cylinders [N]; they pull with the head side empty."""
    k, relief = p[P_LINKAGE:], p[P_LIFT + SERVO_RELIEF]
    push = relief * k[K_LIFT_HEAD] - k[K_LIFT_BACK] * k[K_LIFT_ROD]
    return within_stroke(-relief * k[K_LIFT_ROD], push, state[JOINT + LIFT_ARM], p[P_LIFT:])


@uncounted
def tilt_bounds(state: Array, p: Array) -> tuple[float, float]:
    """Least and greatest force of the tilt cylinder [N]; it pulls with the head side empty."""
    k, relief = p[P_LINKAGE:], p[P_TILT + SERVO_RELIEF]
    push = relief * k[K_TILT_HEAD] - k[K_TILT_BACK] * k[K_TILT_ROD]
    return within_stroke(-relief * k[K_TILT_ROD], push, state[JOINT + BUCKET], p[P_TILT:])


@uncounted
def surely_within(state: Array, p: Array, tree: Tree) -> bool:
    """Whether no cylinder can be at its bounds (plant.physics.relief_guard); after the tree is solved."""
    joint, arm, bucket = tree.effort[FRONT_FRAME], tree.effort[LIFT_ARM], tree.effort[BUCKET]
    shared = p[P_GUARD + G_COUPLING] * abs(bucket)
    return (
        arm + shared <= p[P_GUARD + G_LIFT + 1]
        and arm - shared >= p[P_GUARD + G_LIFT]
        and p[P_GUARD + G_TILT] <= bucket <= p[P_GUARD + G_TILT + 1]
        and abs(joint) <= p[P_GUARD + G_STEERING]
        and p[P_GUARD + G_STROKES] <= state[JOINT + FRONT_FRAME] <= p[P_GUARD + G_STROKES + 1]
        and p[P_GUARD + G_STROKES + 2] <= state[JOINT + LIFT_ARM] <= p[P_GUARD + G_STROKES + 3]
        and p[P_GUARD + G_STROKES + 4] <= state[JOINT + BUCKET] <= p[P_GUARD + G_STROKES + 5]
    )


@uncounted
def overloaded(state: Array, p: Array, tree: Tree) -> bool:
    """Whether any cylinder would need a force beyond its bounds; after the tree is solved, where it is not `surely_within`."""
    steering, lift, tilt = forces(state, p, tree)
    low, high = lift_bounds(state, p)
    if lift < low or lift > high:
        return True
    low, high = tilt_bounds(state, p)
    if tilt < low or tilt > high:
        return True
    low, high = steering_bounds(state, p)
    return steering < low or steering > high


@compiled
def give_way(state: Array, p: Array, tree: Tree) -> None:
    """Solve the tree with the overloaded cylinders at their bounds. Inertias and forces of the tree are fresh."""
    inertia, bias, effort = tree.inertia.copy(), tree.bias.copy(), tree.effort.copy()
    asked = np.array((tree.joint_acceleration[FRONT_FRAME], tree.joint_acceleration[LIFT_ARM], 0.0))
    asked[2] = tree.joint_acceleration[BUCKET] + asked[1]  # of the bucket against the front frame
    low, high = np.empty(CYLINDERS), np.empty(CYLINDERS)
    low[0], high[0] = steering_bounds(state, p)
    low[1], high[1] = lift_bounds(state, p)
    low[2], high[2] = tilt_bounds(state, p)
    given, slope = np.empty(CYLINDERS), np.empty((CYLINDERS, CYLINDERS))
    solve_at(asked, tree, inertia, bias, effort)
    given[0], given[1], given[2] = forces(state, p, tree)
    for i in range(CYLINDERS):
        other = asked.copy()
        other[i] += 1.0
        solve_at(other, tree, inertia, bias, effort)
        steering, lift, tilt = forces(state, p, tree)
        slope[0, i], slope[1, i], slope[2, i] = steering - given[0], lift - given[1], tilt - given[2]
    solve_at(asked + change_at_bounds(given, slope, low, high), tree, inertia, bias, effort)


@compiled
def change_at_bounds(given: Array, slope: Array, low: Array, high: Array) -> Array:
    """Change of the accelerations that brings each force beyond its bounds back to them and leaves the other joints as they were.

    given: forces (n,); slope: their derivatives by the accelerations (n, n).
    """
    n = given.size
    rows, wanted, force, change = np.eye(n), np.zeros(n), given.copy(), np.zeros(n)
    for _ in range(n):  # a cylinder that yields may overload another one, so repeat
        found = False
        for i in range(n):
            bound = min(max(force[i], low[i]), high[i])
            if abs(force[i] - bound) > 1e-9 * abs(force[i]):
                rows[i], wanted[i] = slope[i], bound - given[i]
                found = True
        if not found:
            break
        change[:] = np.linalg.solve(rows, wanted)
        force[:] = given + slope @ change
    return change


@compiled
def solve_at(acceleration: Array, tree: Tree, inertia: Array, bias: Array, effort: Array) -> None:
    """Solve the tree for accelerations of joint, arm and bucket (against the front frame); the rest as given."""
    tree.inertia[:], tree.bias[:], tree.effort[:] = inertia, bias, effort
    if tree.driven[FRONT_FRAME] > 0.0:
        tree.joint_acceleration[FRONT_FRAME] = acceleration[0]
    tree.joint_acceleration[LIFT_ARM] = acceleration[1]
    tree.joint_acceleration[BUCKET] = acceleration[2] - acceleration[1]
    solve_tree(tree)
