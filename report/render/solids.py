"""Solids as triangles: boxes, prisms and cylinders placed in frames of reference. SI, ISO 8855."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Colour = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles of one colour."""

    corners: Array  # (n, 3 corners, 3) in the world [m]
    colour: Colour  # red, green, blue, 0 to 1
    shadow: bool = True  # whether it casts a shadow


@dataclass(frozen=True, slots=True)
class Pose:
    """A frame of reference."""

    origin: Array  # (3,) in the world [m]
    rotation: Array  # (3, 3), world from frame

    def points(self, local: ArrayLike) -> Array:
        """World positions of points (..., 3) given in this frame."""
        return np.asarray(local, float) @ self.rotation.T + self.origin

    def turned(self, at: ArrayLike, rotation: Array) -> "Pose":
        """The frame with its origin at `at` in this one, turned by `rotation`."""
        return Pose(self.points(at), self.rotation @ rotation)

    def box(self, centre: ArrayLike, half: ArrayLike, colour: Colour) -> Mesh:
        """A box along the axes of this frame, by its half lengths."""
        x, y, z = np.asarray(half, float)
        outline = ((-x, -z), (x, -z), (x, z), (-x, z))
        return self.prism(outline, -y, y, colour, at=centre)

    def prism(
        self, outline: ArrayLike, right: float, left: float, colour: Colour, *, at: ArrayLike = (0, 0, 0)
    ) -> Mesh:
        """A convex outline (n, 2) in x and z, drawn out along y from `right` to `left`."""
        return self.loft(outline, right, outline, left, colour, at=at)

    def loft(
        self,
        first: ArrayLike,
        right: float,
        second: ArrayLike,
        left: float,
        colour: Colour,
        *,
        at: ArrayLike = (0, 0, 0),
    ) -> Mesh:
        """Between a convex outline (n, 2) in x and z at y = right and another of as many corners at y = left."""
        ends = []
        for outline, y in ((first, right), (second, left)):
            xz = np.asarray(outline, float)
            ends.append(np.column_stack((xz[:, 0], np.full(len(xz), y), xz[:, 1])) + np.asarray(at, float))
        return Mesh(self.points(_between(*ends)), colour)

    def ring(self, radii: Sequence[float], sides: Sequence[float], count: int, colour: Colour) -> Mesh:
        """A body of revolution about y: radius after radius at the offsets `sides`, closed at its ends."""
        turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
        rims = [
            np.column_stack((r * np.cos(turn), np.full(count, y), r * np.sin(turn)))
            for r, y in zip(radii, sides, strict=True)
        ]
        skins = [_skin(a, b) for a, b in pairwise(rims)]
        return Mesh(self.points(np.concatenate([_fan(rims[0]), *skins, _fan(rims[-1])])), colour)


def _fan(rim: Array) -> Array:
    """A convex polygon as triangles."""
    n = len(rim)
    return np.stack((np.repeat(rim[:1], n - 2, axis=0), rim[1:-1], rim[2:]), axis=1)


def _skin(one: Array, other: Array) -> Array:
    """The band between two closed lines of as many corners."""
    next_one, next_other = np.roll(one, -1, axis=0), np.roll(other, -1, axis=0)
    return np.concatenate(
        (np.stack((one, next_one, next_other), axis=1), np.stack((one, next_other, other), axis=1))
    )


def _between(one: Array, other: Array) -> Array:
    return np.concatenate((_fan(one), _fan(other), _skin(one, other)))


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
