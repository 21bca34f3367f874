"""Models a wheel loader as solids, posed by one instant of the plant's truth.

Proportions follow the machine file where it has them (axles, track, tyre, arm), else a loader of this
class; they carry no physics. Wheel loads are arrows of a length proportional to the force.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from report.render.solids import Array, Colour, Mesh, Pose, about_x, about_y, about_z, from_quaternion

YELLOW: Colour = (0.95, 0.70, 0.12)
DARK: Colour = (0.23, 0.25, 0.28)
GLASS: Colour = (0.50, 0.66, 0.76)
STEEL: Colour = (0.46, 0.48, 0.51)
TYRE: Colour = (0.15, 0.15, 0.16)
RIM: Colour = (0.82, 0.80, 0.74)
LOAD: Colour = (0.55, 0.42, 0.28)
LIFTED: Colour = (0.84, 0.24, 0.05)
FORCE: Colour = (0.00, 0.45, 0.80)

METRES_PER_NEWTON = 1.0 / 30e3
TYRE_WIDTH = 0.53
LUGS = 20
RIM_RADIUS = 0.36
FIELDS = (
    "position", "attitude", "yaw", "articulation_angle", "oscillation_angle", "lift_arm_angle",
    "tilt_angle", "normal_force", "payload_mass",
)  # fmt: skip
"""Columns of the truth that a picture needs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dimensions:
    """Dimensions of a machine for the drawing [m]; heights are above the ground, of the standing machine."""

    joint_height: float = 0.80
    pivot_height: float = 0.80
    front_axle: float = 1.50
    rear_axle: float = -1.50
    track: float = 1.93
    wheel_height: float = 0.70
    wheel_radius: float = 0.743
    arm_x: float = 0.90
    arm_z: float = 1.98
    arm_length: float = 2.43


@dataclass(frozen=True, slots=True)
class Frames:
    """Frames of reference of the machine's parts. Wheels: FL, FR, RL, RR, y along the axle to the left."""

    rear: Pose
    front: Pose
    axle: Pose
    arm: Pose
    bucket: Pose
    wheels: tuple[Pose, Pose, Pose, Pose]


def frames(instant: Mapping[str, Any], d: Dimensions) -> Frames:
    """The frames of the parts at one instant of the truth."""
    rear = Pose(np.asarray(instant["position"], float), from_quaternion(instant["attitude"]))
    front = rear.turned((0, 0, 0), about_z(float(instant["articulation_angle"])))
    pivot = (d.rear_axle, 0, d.pivot_height - d.joint_height)
    axle = rear.turned(pivot, about_x(float(instant["oscillation_angle"])))
    arm = front.turned((d.arm_x, 0, d.arm_z - d.joint_height), about_y(-float(instant["lift_arm_angle"])))
    # turned from the front frame, not from the arm: the tilt angle is measured against the horizontal
    bucket = Pose(arm.points((d.arm_length, 0, 0)), front.rotation @ about_y(-float(instant["tilt_angle"])))
    half, straight = d.track / 2, np.eye(3)
    wheels = (
        front.turned((d.front_axle, half, d.wheel_height - d.joint_height), straight),
        front.turned((d.front_axle, -half, d.wheel_height - d.joint_height), straight),
        axle.turned((0, half, d.wheel_height - d.pivot_height), straight),
        axle.turned((0, -half, d.wheel_height - d.pivot_height), straight),
    )
    return Frames(rear, front, axle, arm, bucket, wheels)


def machine_meshes(instant: Mapping[str, Any], d: Dimensions) -> list[Mesh]:
    """The whole machine with its wheel loads as arrows; a wheel without load has the warning colour and no arrow."""
    f = frames(instant, d)
    meshes = _rear(f.rear, d) + _front(f, d) + _arm(f.arm, d) + _bucket(f.bucket)
    if float(instant["payload_mass"]) > 0:
        meshes.append(f.bucket.prism(_HEAP, -1.17, 1.17, LOAD))
    for pose, force in zip(f.wheels, np.asarray(instant["normal_force"], float), strict=True):
        meshes += _wheel(pose, d.wheel_radius, TYRE if force > 0 else LIFTED)
        if force > 0:
            meshes += _arrow(pose.origin + np.array((0, 0, d.wheel_radius + 0.08)), float(force))
    return meshes


def _rear(rear: Pose, d: Dimensions) -> list[Mesh]:
    """Engine hood, counterweight, cab, fenders and steps. Heights are above the joint."""
    back = d.rear_axle - 1.05
    hood = ((back, 0.30), (-0.95, 0.30), (-0.95, 1.12), (back + 0.25, 0.95), (back, 0.80))
    weight = ((back - 0.28, 0.05), (back + 0.35, -0.02), (back + 0.35, 0.62), (back - 0.22, 0.66))
    cab = ((-0.98, 0.55), (0.14, 0.55), (0.26, 0.98), (0.06, 1.92), (-0.94, 1.92))
    glass = ((-0.90, 0.98), (0.19, 1.00), (0.03, 1.82), (-0.88, 1.82))
    parts = [
        rear.box((d.rear_axle / 2 - 0.35, 0, 0.16), (-d.rear_axle / 2 + 0.55, 0.42, 0.18), DARK),
        rear.prism(hood, -0.60, 0.60, YELLOW),
        rear.box((back + 0.02, 0, 0.60), (0.03, 0.42, 0.22), DARK),  # grille
        rear.prism(weight, -0.92, 0.92, DARK),
        rear.prism(cab, -0.62, 0.62, YELLOW),
        rear.prism(glass, -0.64, 0.64, GLASS),
        rear.prism(
            ((0.20, 1.02), (0.27, 1.02), (0.09, 1.80), (0.02, 1.80)), -0.54, 0.54, GLASS
        ),  # windscreen
        rear.box((-0.42, 0, 1.97), (0.60, 0.70, 0.06), DARK),  # roof
        rear.box((back + 0.75, -0.30, 1.28), (0.05, 0.05, 0.32), DARK),  # exhaust
    ]
    for side in (1, -1):
        parts += [
            rear.box((d.rear_axle, side * d.track / 2, 0.80), (0.66, 0.26, 0.03), DARK),  # fender
            rear.box((d.rear_axle + 0.72, side * d.track / 2, 0.64), (0.03, 0.26, 0.17), DARK),
            rear.box((-0.55, side * 0.80, -0.10), (0.20, 0.10, 0.03), STEEL),  # steps
            rear.box((-0.55, side * 0.80, 0.24), (0.20, 0.10, 0.03), STEEL),
        ]
    return parts


def _front(f: Frames, d: Dimensions) -> list[Mesh]:
    """Front frame with the towers that carry the arm, and both axles."""
    top = d.arm_z - d.joint_height + 0.12
    x = d.arm_x
    tower = ((x - 0.34, 0.02), (x + 0.55, 0.02), (x + 0.22, top), (x - 0.16, top))
    axle_height = d.wheel_height - d.joint_height
    parts = [f.front.box((0.75, 0, 0.08), (0.78, 0.34, 0.22), DARK)]
    for side in (1, -1):
        parts.append(f.front.prism(tower, side * 0.30 - 0.05, side * 0.30 + 0.05, YELLOW))
        fender = ((0.78, 0.60), (0.84, 0.60), (1.02, 0.86), (0.98, 0.90))
        parts.append(f.front.prism(fender, side * d.track / 2 - 0.26, side * d.track / 2 + 0.26, DARK))
    for frame, x_axle, z in (
        (f.front, d.front_axle, axle_height),
        (f.axle, 0.0, d.wheel_height - d.pivot_height),
    ):
        parts.append(frame.box((x_axle, 0, z), (0.13, d.track / 2, 0.13), DARK))
        parts.append(frame.box((x_axle, 0, z), (0.24, 0.26, 0.22), DARK))
    return parts


def _arm(arm: Pose, d: Dimensions) -> list[Mesh]:
    """Two lift arms bent upwards, their cross tube, and the lever of the tilt linkage."""
    length, bend = d.arm_length, (0.62 * d.arm_length, 0.26)
    inner = ((-0.12, -0.12), (bend[0], bend[1] - 0.20), (bend[0], bend[1] + 0.16), (-0.10, 0.13))
    outer = (
        (bend[0], bend[1] - 0.20),
        (length + 0.08, -0.13),
        (length + 0.10, 0.10),
        (bend[0], bend[1] + 0.16),
    )
    parts = []
    for side in (1, -1):
        middle = side * 0.44
        parts += [arm.prism(outline, middle - 0.06, middle + 0.06, YELLOW) for outline in (inner, outer)]
    tube = ((bend[0] - 0.12, 0.10), (bend[0] + 0.12, 0.10), (bend[0] + 0.12, 0.34), (bend[0] - 0.12, 0.34))
    lever = ((bend[0] - 0.08, 0.10), (bend[0] + 0.14, 0.06), (bend[0] + 0.10, 0.80), (bend[0] - 0.08, 0.80))
    rod = ((0.05, 0.10), (bend[0], 0.66), (bend[0], 0.76), (0.05, 0.22))
    return [
        *parts,
        arm.prism(tube, -0.44, 0.44, YELLOW),
        arm.prism(lever, -0.07, 0.07, YELLOW),
        arm.prism(rod, -0.05, 0.05, STEEL),
    ]


_PROFILE = ((1.02, -0.12), (0.10, -0.14), (-0.14, 0.06), (-0.20, 0.40), (-0.06, 0.78), (0.16, 0.96))
"""Inside of the bucket from the cutting edge over the bottom to the top of its back, x and z from its pin."""
_HEAP = ((0.95, -0.08), (0.10, -0.10), (-0.12, 0.10), (-0.16, 0.40), (0.02, 0.78), (0.40, 0.80), (0.80, 0.45))
_CHEEK = (
    (1.02, -0.12),
    (0.10, -0.14),
    (-0.14, 0.06),
    (-0.20, 0.40),
    (-0.06, 0.78),
    (0.16, 0.96),
    (0.34, 0.80),
)


def _bucket(bucket: Pose) -> list[Mesh]:
    parts = []
    for (x0, z0), (x1, z1) in pairwise(_PROFILE):
        along = np.array((x1 - x0, z1 - z0))
        out = 0.03 * np.array((along[1], -along[0])) / np.hypot(*along) * -1
        plate = ((x0, z0), (x1, z1), (x1 - out[0], z1 - out[1]), (x0 - out[0], z0 - out[1]))
        parts.append(bucket.prism(plate, -1.24, 1.24, STEEL))
    parts += [bucket.prism(_CHEEK, side * 1.22 - 0.02, side * 1.22 + 0.02, STEEL) for side in (1, -1)]
    edge = ((0.90, -0.12), (1.14, -0.13), (1.14, -0.15), (0.90, -0.16))
    return [*parts, bucket.prism(edge, -1.26, 1.26, DARK)]


def _wheel(pose: Pose, radius: float, colour: Colour) -> list[Mesh]:
    """A tyre with lugs, a dished rim and a hub; y is the axle."""
    half = TYRE_WIDTH / 2
    carcass = radius - 0.035
    shoulder = carcass - 0.09
    parts = [
        pose.ring(
            (RIM_RADIUS, shoulder, carcass, carcass, shoulder, RIM_RADIUS),
            (-half + 0.03, -half, -half + 0.08, half - 0.08, half, half - 0.03),
            32,
            colour,
        ),
        pose.ring((RIM_RADIUS, RIM_RADIUS), (-half + 0.025, half - 0.025), 24, RIM),
        pose.ring((0.17, 0.15), (-half - 0.03, half + 0.03), 12, DARK),
    ]
    half_step = np.pi / LUGS
    for n in range(LUGS):
        for side, turn in ((1, 0.0), (-1, half_step)):
            lug = pose.turned((0, 0, 0), about_y(2 * n * half_step + turn))
            inner = ((-0.035, carcass - 0.02), (0.035, carcass - 0.02), (0.03, radius), (-0.03, radius))
            outer = tuple((x + 0.09, z - 0.035) for x, z in inner)
            ends = (inner, side * 0.01, outer, side * (half - 0.01))
            parts.append(lug.loft(*ends, colour))
    return parts


def _arrow(foot: Array, force: float) -> list[Mesh]:
    """An arrow upwards from `foot`; its length is the force over 30 kN in metres."""
    length = force * METRES_PER_NEWTON
    head = min(0.26, 0.6 * length)
    upright = Pose(np.asarray(foot, float), about_x(np.pi / 2))  # a ring's axis from y to z
    shaft = upright.ring((0.045, 0.045), (0.0, length - head), 12, FORCE)
    tip = upright.ring((0.13, 0.001), (length - head, length), 16, FORCE)
    return [replace(part, shadow=False) for part in (shaft, tip)]
