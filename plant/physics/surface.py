"""The road: a plane through the world's origin with grade, bank and friction."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Surface:
    """A plane road.

    friction: sliding friction coefficient; 0.75 is asphalt and the tyres' own nominal one.
    grade: slope along the world's x axis [rad], positive when +x is uphill.
    bank: slope along the road's y axis [rad], positive when the left side (+y) is higher.
    """

    friction: float = 0.75
    grade: float = 0.0
    bank: float = 0.0

    def __post_init__(self) -> None:
        if not 0.01 <= self.friction <= 2.0:
            raise ValueError(f"friction={self.friction} is outside 0.01..2.0")
        for name, value in (("grade", self.grade), ("bank", self.bank)):
            if not abs(value) <= math.radians(45.0):
                raise ValueError(
                    f"{name}={value} rad is outside -0.785..0.785 rad (45 degrees): was it given in degrees or per cent?"
                )

    def axes(self) -> NDArray[np.float64]:
        """Road axes as the columns of a rotation matrix, world from road; the last one is the normal."""
        cg, sg = math.cos(self.grade), math.sin(self.grade)
        cb, sb = math.cos(self.bank), math.sin(self.bank)
        climb = np.array([[cg, 0.0, -sg], [0.0, 1.0, 0.0], [sg, 0.0, cg]])  # about y by -grade
        lean = np.array([[1.0, 0.0, 0.0], [0.0, cb, -sb], [0.0, sb, cb]])  # about x by bank
        return climb @ lean


def road_axes(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Road axes as the columns of a rotation matrix, for a plane with this unit normal; x lies above the world's."""
    size = math.hypot(normal[0], normal[2])
    ahead = np.array([normal[2] / size, 0.0, -normal[0] / size])
    return np.column_stack((ahead, np.cross(normal, ahead), normal))
