"""What makes the ECU's joint torque differ from the plant's, and what would without its law of the tilted frame: one change at a time, in the same drive.

The estimator computes the torque from moments of the measured motion and from the wheels' longitudinal forces. Both are taken apart here and
put together again with one part as the plant has it.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ecu.estimators.columns import estimate_columns
from ecu.estimators.joint import Joint
from ecu.estimators.loads.leaning import leaning
from ecu.estimators.parameters import Parameters
from ecu.estimators.quantities import NormalForces
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.tyres.contact import Tilt
from studies.thesis.drive import Array, Truths, inputs_of
from studies.thesis.split import Split, parameters_of

QUICK = 1e-3
"""Time constant of a filter that does nothing [s]."""
PLAIN = "as it is"
ALIGNING = "aligning moments of the plant"
LOAD = "empty bucket known"
UNFILTERED = "angular accelerations unfiltered"
LEVEL = "wheel loads square to the frame"
LEVEL_UNFILTERED = "the last two together"
ALL = "empty bucket known and angular accelerations unfiltered"


class Moved(NamedTuple):
    """What the motion requires, by the estimator: side force [N], moment about the joint and the front unit's part of it [N m]."""

    side: Array  # in rear axes, the longitudinal forces' share included
    moment: Array
    front: Array


class Grip(NamedTuple):
    """What the tyres give beside their lateral forces: longitudinal forces (4, n) [N], aligning moments of both axles [N m], arms of the axles [m]."""

    along: Array
    front_aligning: Array | float
    rear_aligning: Array | float
    front_arm: Array | float
    rear_arm: Array | float


def estimates_of(truth: Truths, p: Parameters, *, empty: bool = False) -> Mapping[str, Array]:
    """The corrected estimates with these parameters; empty: without pressures, so that no payload is seen."""
    rows = inputs_of(truth)
    if empty:
        rows[:, Inputs._fields.index("pressure_usable")] = 0.0
    columns = estimate_columns(rows, p, form="corrected", prediction=False)
    return dict(zip(Estimates._fields, columns.T, strict=True))


def grip_of(e: Mapping[str, Array], p: Parameters) -> Grip:
    """As the estimator has it: its aligning moments are lateral forces at a pneumatic trail."""
    trail = p.wheel.pneumatic_trail * np.clip(e["speed"] / 0.5, -1.0, 1.0)
    along = np.array([e[f"longitudinal_{n}"] for n in range(1, 5)])
    return Grip(along, 0.0, 0.0, p.geometry.front_length - trail, p.geometry.rear_length + trail)


def turned_by(along: Array, p: Parameters) -> tuple[Array, Array]:
    """Moments of longitudinal forces about the joint, of the front and of the rear wheels [N m]."""
    g = p.geometry
    return g.front_track / 2.0 * (along[1] - along[0]), g.rear_track / 2.0 * (along[3] - along[2])


def moved_of(e: Mapping[str, Array], angle: Array, p: Parameters) -> Moved:
    """The estimator's moments, from its forces and its torque: its own balance, read backwards."""
    grip = grip_of(e, p)
    front_x, rear_x = turned_by(grip.along, p)
    front, rear = e["lateral_1"] + e["lateral_2"], e["lateral_3"] + e["lateral_4"]
    c, s = np.cos(angle), np.sin(angle)
    side = rear + front * c
    moment = front * (grip.front_arm + grip.rear_arm * c) + front_x + rear_x - grip.rear_arm * side
    return Moved(
        side + (grip.along[0] + grip.along[1]) * s,
        moment,
        e["joint_torque"] + front_x + grip.front_arm * front,
    )


def torque_of(moved: Moved, grip: Grip, angle: Array, p: Parameters) -> Array:
    """The joint torque [N m] that this motion and these tyres require."""
    front_x, rear_x = turned_by(grip.along, p)
    c, s = np.cos(angle), np.sin(angle)
    side = moved.side - (grip.along[0] + grip.along[1]) * s
    turning = moved.moment - front_x - rear_x - grip.front_aligning - grip.rear_aligning
    front = (turning + grip.rear_arm * side) / (grip.front_arm + grip.rear_arm * c)
    return moved.front - front_x - grip.front_aligning - grip.front_arm * front


def level(truth: Truths, moved: Moved, p: Parameters) -> Moved:
    """The same as if wheel loads were square to the frames: what their parts along and across the tilted frames give is left to the tyres."""
    # whole columns where the law has numbers: it only adds and multiplies
    t: Any = truth
    d, n = t["articulation_angle"], t["normal_force"].T
    loads = NormalForces(n[0], n[1], np.zeros_like(d), n[2], n[3])
    joint: Any = (d, np.cos(d), np.sin(d))
    lean = leaning(loads, Tilt(t["roll"], t["pitch"]), Joint(*joint), p.geometry)
    return Moved(
        moved.side + lean.across,
        moved.moment + lean.front_moment + lean.rear_moment,
        moved.front + lean.front_moment,
    )


def plants_aligning(truth: Truths, grip: Grip, p: Parameters) -> Grip:
    """The same with the plant's aligning moments instead of a trail."""
    m, g = truth["aligning_moment"], p.geometry
    return Grip(grip.along, m[:, 0] + m[:, 1], m[:, 2] + m[:, 3], g.front_length, g.rear_length)


def changed(truth: Truths, split: Split) -> dict[str, Array]:
    """The ECU's joint torque [N m] with each change in turn."""
    p, angle = parameters_of(split), truth["articulation_angle"]
    quick = p._replace(sensors=p.sensors._replace(rate_time=QUICK))
    e, still = estimates_of(truth, p), estimates_of(truth, p, empty=True)
    fast, best = estimates_of(truth, quick), estimates_of(truth, quick, empty=True)
    grip, moved = grip_of(e, p), moved_of(e, angle, p)
    fast_level = level(truth, moved_of(fast, angle, quick), quick)
    return {
        PLAIN: e["joint_torque"],
        ALIGNING: torque_of(moved, plants_aligning(truth, grip, p), angle, p),
        LOAD: still["joint_torque"],
        UNFILTERED: fast["joint_torque"],
        LEVEL: torque_of(level(truth, moved, p), grip, angle, p),
        LEVEL_UNFILTERED: torque_of(fast_level, grip_of(fast, quick), angle, quick),
        ALL: best["joint_torque"],
    }
