"""How far the load on the bucket and the force of a pile may be off while their estimates follow the pressures.

An estimate that follows a quantity with a lag is off by what the quantity has moved meanwhile; the gap between what the pressures say in
this cycle and what is followed shows by how much. The truth lies anywhere within that gap to either side. In a pile two more things are
open: what is dug cannot be separated from the pile's push, and the moment that turns an accelerating arm passes for a force on the edge.
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.loads.cog import Pose
from ecu.estimators.loads.payload import EMPTY, BucketLoad, Push, Residual, loaded, pushed
from ecu.estimators.motion.arm import Turning, accelerating
from ecu.estimators.parameters import Parameters
from ecu.estimators.quantities import Vector
from ecu.estimators.signals import Inputs


class Doubt(NamedTuple):
    """Bounds of one error: by what it moves the machine's load and its moment, and the payload."""

    load: float  # on the ground [N]
    pitching: float  # about the joint, in the front frame's plane, nose down [N m]
    payload: float  # [kg]
    ahead: float  # where the payload lies, from the joint on the ground, front frame's axes [m]
    height: float


@compiled
def doubt_of(
    i: Inputs,
    r: Residual,
    along: Vector,
    load: BucketLoad,
    push: Push,
    lift: Turning,
    pose: Pose,
    p: Parameters,
) -> Doubt:
    """The doubt of one cycle. r: `residual` at `along`; along: specific force at the front unit, front frame's axes [m/s2]."""
    ahead = p.arm.pivot_x + pose.pin_x + pose.load_x
    height = p.arm.pivot_z + pose.pin_z + pose.load_z
    if i.pressure_usable == 0.0:
        return Doubt(0.0, 0.0, 0.0, ahead, height)
    if load.digging != 0.0:
        x, z = pushed(i, r, load.payload, load.couple, load.traction, along, p)
        dug = max(-load.z, 0.0) / along.z
        mass = p.bucket.mass + load.payload + dug
        about_pivot = p.arm.pitch_inertia + p.arm.mass * p.arm.along * p.arm.along
        turned = (about_pivot + mass * p.arm.length * p.arm.length) * abs(lift.acceleration) / pose.pin_x
        down = abs(z - load.z) + turned
        # both gaps with the signs of one cycle: the balances that they come from share the pressures
        down = down if z >= load.z else -down
        return Doubt(-down, push.height * (x - load.x) - push.ahead * down, dug, ahead, height)
    if i.tilt_pressure < EMPTY or accelerating(lift):
        return Doubt(0.0, 0.0, 0.0, ahead, height)
    fresh, couple = loaded(i, r, along.x, along.z, p)
    more = fresh - load.payload
    pitching = more * (ahead * along.z - height * along.x) + couple - load.couple
    return Doubt(more * along.z, pitching, more, ahead, height)
