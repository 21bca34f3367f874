"""Named tuples of forces, positions and accelerations that both forms of the estimators use; no equations."""

from typing import NamedTuple


class Vector(NamedTuple):
    """Components along x, y, z of the rear frame."""

    x: float
    y: float
    z: float


class Centre(NamedTuple):
    """Mass [kg] and centre of gravity [m], in the axes of the rear frame."""

    mass: float
    x: float
    y: float
    z: float


class NormalForces(NamedTuple):
    """Normal forces of the road on the tyres [N]; negative: the pull that would keep the wheel down."""

    front_left: float
    front_right: float
    pivot: float  # of the rear axle: loads the axle from above
    rear_left: float
    rear_right: float


class WheelForces(NamedTuple):
    """Forces of the road on the four tyres [N], in the axes of the wheels; 1 FL, 2 FR, 3 RL, 4 RR."""

    x1: float
    x2: float
    x3: float
    x4: float
    y1: float
    y2: float
    y3: float
    y4: float
