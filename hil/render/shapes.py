"""The machine as boxes and cylinders in the world, from one instant of the plant's truth.

Proportions follow the machine file where it has them (track, wheelbase, tyre radius, arm), else a
loader of this class; they carry no physics. SI, ISO 8855.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Colour = tuple[float, float, float]

YELLOW: Colour = (0.95, 0.70, 0.12)
DARK: Colour = (0.20, 0.22, 0.25)
GLASS: Colour = (0.45, 0.62, 0.72)
STEEL: Colour = (0.50, 0.52, 0.55)
TYRE: Colour = (0.13, 0.13, 0.14)
RIM: Colour = (0.80, 0.78, 0.70)
LOAD: Colour = (0.55, 0.42, 0.28)
LIFTED: Colour = (0.85, 0.20, 0.12)
FORCE: Colour = (0.05, 0.55, 0.35)

FORCE_SCALE = 1.0 / 40e3  # metres of arrow per newton: a standing front wheel shows 0.7 m
TYRE_WIDTH = 0.53


@dataclass(frozen=True, slots=True)
class Shape:
    """A solid in the world. size: half lengths of a box, or (radius, half length) of a cylinder along its z."""

    kind: Literal["box", "cylinder"]
    centre: Array
    rotation: Array  # (3, 3) world from shape
    size: tuple[float, ...]
    colour: Colour


@dataclass(frozen=True, slots=True, kw_only=True)
class Dimensions:
    """What the drawing needs of a machine [m]."""

    joint_height: float = 0.80
    front_axle: float = 1.50
    rear_axle: float = -1.50
    track: float = 1.93
    wheel_height: float = 0.70
    wheel_radius: float = 0.743
    arm_x: float = 0.90
    arm_z: float = 1.98
    arm_length: float = 2.43


@dataclass(frozen=True, slots=True)
class Pose:
    """A frame of reference: origin in the world and rotation, world from frame."""

    origin: Array
    rotation: Array

    def point(self, x: float, y: float, z: float) -> Array:
        """World position of a point given in this frame."""
        return self.origin + self.rotation @ np.array((x, y, z))

    def turned(self, at: tuple[float, float, float], rotation: Array) -> "Pose":
        """The frame with its origin at `at` in this one, turned by `rotation`."""
        return Pose(self.point(*at), self.rotation @ rotation)

    def box(self, x: float, y: float, z: float, half: tuple[float, float, float], colour: Colour) -> Shape:
        """A box centred at a point of this frame, along its axes."""
        return Shape("box", self.point(x, y, z), self.rotation, half, colour)


def about_x(angle: float) -> Array:
    """Rotation about x: left side up."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array(((1, 0, 0), (0, c, -s), (0, s, c)))


def about_y(angle: float) -> Array:
    """Rotation about y: nose down."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array(((c, 0, s), (0, 1, 0), (-s, 0, c)))


def about_z(angle: float) -> Array:
    """Rotation about z: to the left."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array(((c, -s, 0), (s, c, 0), (0, 0, 1)))


def from_quaternion(quaternion: ArrayLike) -> Array:
    """Rotation matrix of a unit quaternion w, x, y, z."""
    w, x, y, z = np.asarray(quaternion, float)
    return np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
    )


@dataclass(frozen=True, slots=True)
class Frames:
    """Frames of reference of the machine's parts."""

    rear: Pose
    front: Pose
    axle: Pose
    arm: Pose
    bucket: Pose

    def wheel_centres(self, d: Dimensions) -> Array:
        """(4, 3) in the world, FL FR RL RR."""
        half, height = d.track / 2, d.wheel_height - d.joint_height
        front = [self.front.point(d.front_axle, side * half, height) for side in (1, -1)]
        rear = [self.axle.point(0.0, side * half, d.wheel_height - d.joint_height) for side in (1, -1)]
        return np.array(front + rear)


def frames(instant: Mapping[str, Any], d: Dimensions) -> Frames:
    """Where the parts are at one instant of the truth."""
    rear = Pose(np.asarray(instant["position"], float), from_quaternion(instant["attitude"]))
    front = rear.turned((0, 0, 0), about_z(float(instant["articulation_angle"])))
    axle = rear.turned((d.rear_axle, 0, 0), about_x(float(instant["oscillation_angle"])))
    arm = front.turned((d.arm_x, 0, d.arm_z - d.joint_height), about_y(-float(instant["lift_arm_angle"])))
    pin = arm.point(d.arm_length, 0, 0)
    bucket = Pose(pin, front.rotation @ about_y(-float(instant["tilt_angle"])))
    return Frames(rear, front, axle, arm, bucket)


def machine_shapes(instant: Mapping[str, Any], d: Dimensions) -> list[Shape]:
    """The whole machine with its wheel loads as arrows; a wheel without load is red."""
    f = frames(instant, d)
    j = d.joint_height
    shapes = [
        f.rear.box(-1.05, 0, 0.30, (0.95, 0.42, 0.18), DARK),  # rear frame
        f.rear.box(-1.75, 0, 0.80, (0.90, 0.62, 0.42), YELLOW),  # engine hood
        f.rear.box(-2.62, 0, 0.35, (0.16, 0.85, 0.36), DARK),  # counterweight
        f.rear.box(-0.42, 0, 0.62, (0.46, 0.60, 0.28), YELLOW),  # cab base
        f.rear.box(-0.42, 0, 1.40, (0.44, 0.56, 0.52), GLASS),
        f.rear.box(-0.42, 0, 1.98, (0.50, 0.62, 0.06), YELLOW),  # roof
        f.front.box(0.85, 0, 0.20, (0.80, 0.34, 0.20), DARK),  # front frame
        f.front.box(d.front_axle, 0, d.wheel_height - j, (0.14, d.track / 2, 0.14), DARK),  # axles
        f.axle.box(0, 0, d.wheel_height - j, (0.14, d.track / 2, 0.14), DARK),
        f.front.box(0.95, 0, d.arm_z - j - 0.42, (0.14, 0.40, 0.50), YELLOW),  # towers of the arm
        *(
            f.arm.box(d.arm_length / 2, side * 0.40, 0, (d.arm_length / 2, 0.07, 0.16), YELLOW)
            for side in (1, -1)
        ),
        f.bucket.box(0.50, 0, -0.02, (0.62, 1.24, 0.03), STEEL),  # bottom
        f.bucket.box(-0.10, 0, 0.42, (0.03, 1.24, 0.44), STEEL),  # back
        *(f.bucket.box(0.40, side * 1.23, 0.30, (0.50, 0.03, 0.30), STEEL) for side in (1, -1)),
    ]
    if float(instant["payload_mass"]) > 0:
        shapes.append(f.bucket.box(0.42, 0, 0.42, (0.45, 1.15, 0.36), LOAD))
    return shapes + _wheels(instant, f, d)


def _wheels(instant: Mapping[str, Any], f: Frames, d: Dimensions) -> list[Shape]:
    shapes = []
    upright = about_x(np.pi / 2)  # a cylinder's axis from z to y
    for centre, rotation, force in zip(
        f.wheel_centres(d),
        (f.front.rotation, f.front.rotation, f.axle.rotation, f.axle.rotation),
        np.asarray(instant["normal_force"], float),
        strict=True,
    ):
        lifted = not force > 0
        along = rotation @ upright
        shapes.append(
            Shape("cylinder", centre, along, (d.wheel_radius, TYRE_WIDTH / 2), LIFTED if lifted else TYRE)
        )
        shapes.append(Shape("cylinder", centre, along, (0.36, TYRE_WIDTH / 2 + 0.02), RIM))
        if not lifted:
            shapes.append(_arrow(centre, float(force)))
    return shapes


def _arrow(centre: Array, force: float) -> Shape:
    """The road's push as a post that rises from above the tyre."""
    length = force * FORCE_SCALE
    return Shape(
        "cylinder", centre + np.array((0, 0, 0.80 + length / 2)), np.eye(3), (0.05, length / 2), FORCE
    )
