"""Wheel loads on a frame that is tilted on its tyres: a load is square to the road, and the frame's axes are not.

In the frame's axes a load therefore has parts along and across. Those of the outer and of the inner wheel differ as
their loads do, so that both together turn the frame about the joint. ISO 8855, left +, rear frame axes.
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.joint import Joint
from ecu.estimators.parameters import Geometry
from ecu.estimators.quantities import NormalForces
from ecu.estimators.tyres.contact import Tilt


class Leaning(NamedTuple):
    """The wheel loads' parts along and across the frames, and their moments about the joint."""

    along: float  # of all wheels, along x of the rear frame [N]
    across: float  # of all wheels, along y of the rear frame [N]
    rear: float  # of the rear wheels, along y of the rear frame [N]
    front_moment: float  # of the front wheels, about the joint's axis [N m]
    rear_moment: float  # of the rear wheels [N m]
    roll: float  # of the rear frame against the road [rad]


@compiled
def leaning(n: NormalForces, tilt: Tilt, joint: Joint, g: Geometry) -> Leaning:
    """The parts of these loads; tilt: of the rear frame against the road, roll left up, pitch nose down [rad]."""
    c, s = joint.cosine, joint.sine
    front_pitch = tilt.pitch * c - tilt.roll * s
    front_roll = tilt.roll * c + tilt.pitch * s
    front, behind = n.front_left + n.front_right, n.rear_left + n.rear_right
    front_moment = g.front_length * front * front_roll
    front_moment += g.front_track / 2.0 * (n.front_left - n.front_right) * front_pitch
    rear_moment = g.rear_track / 2.0 * (n.rear_left - n.rear_right) * tilt.pitch
    rear_moment -= g.rear_length * behind * tilt.roll
    return Leaning(
        -(front + behind) * tilt.pitch,
        (front + behind) * tilt.roll,
        behind * tilt.roll,
        front_moment,
        rear_moment,
        tilt.roll,
    )
