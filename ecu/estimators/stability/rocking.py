"""Rocking of the machine on its tyres: heave, pitch and roll together.

The machine is a rigid body on three springs: the front left tyre, the front right one, and the rear pair below the oscillation pivot. Its
motion is told by the loads of these springs, as deviations from the quasi-static loads (`rollover.loads_of`). In a bent machine the three
motions are coupled. No tyre slides meanwhile: the rear axle does not move along the machine, and neither the pivot nor the middle of the
front axle moves across it. ISO 8855, joint origin, rear frame axes.
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.joint import Joint
from ecu.estimators.parameters import GRAVITY, Geometry
from ecu.estimators.quantities import NormalForces
from ecu.estimators.stability.rollover import LoadedMachine
from ecu.estimators.stability.start import WEIGHTS, WEIGHTS_RATE, within


class Rocking(NamedTuple):
    """How far the loads of front left wheel, front right wheel and rear axle are from the quasi-static ones, and how fast that changes."""

    left: float  # [N]
    right: float
    rear: float
    left_rate: float  # [N/s]
    right_rate: float
    rear_rate: float
    left_load: float  # the quasi-static ones of the step before [N]
    right_load: float
    pivot_load: float


STILL = Rocking(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The tyres carry what rests on them."""


class RestoringMatrix(NamedTuple):
    """Stiffness times inverse inertia: what restores the loads, [N/s2] of the first spring per [N] of deviation of the second, hence [1/s2]."""

    left_left: float
    left_right: float
    left_rear: float
    right_left: float
    right_right: float
    right_rear: float
    rear_left: float
    rear_right: float
    rear_rear: float
    damping: float  # of the tyres over their stiffness [s]


class Inertia(NamedTuple):
    """The machine's inertia in heave, pitch (nose down) and roll (left up) about the joint's origin: [kg], [kg m], [kg m2]."""

    heave: float
    heave_pitch: float
    heave_roll: float
    pitch: float
    pitch_roll: float
    roll: float
    tipping: float  # moment of the weight per angle of roll [N m]


@inlined
def lump(
    mass: float, x: float, y: float, z: float, roll: float, pitch: float, product: float, yaw: float, turn: float,
    g: Geometry,
) -> Inertia:  # fmt: skip
    """Share of one lump at (x, y, z) [m]; roll, pitch, product, yaw: its own inertia [kg m2].

    turn: yaw that goes with a roll, so that front axle and pivot stay in their tracks.
    """
    above = z - g.pivot_height + turn * (x + g.rear_length)  # what moves sideways in a roll
    along = turn * y
    return Inertia(
        mass,
        -mass * x,
        mass * y,
        pitch + mass * (x * x + z * z),
        product + mass * (z * along - x * y),
        roll + turn * turn * yaw + mass * (y * y + above * above + along * along),
        GRAVITY * mass * above,
    )


@inlined
def inertia_of(joint: Joint, m: LoadedMachine) -> Inertia:
    """The inertia of front unit, rear frame and rear axle; the axle does not roll with the frame."""
    g, c, s = m.geometry, joint.cosine, joint.sine
    front, rear, axle = m.front, m.rear, m.axle
    turn = g.pivot_height * c / (g.front_length + g.rear_length * c)
    difference = front.roll_inertia - front.pitch_inertia
    f = lump(
        front.mass, front.x * c, front.x * s, front.z, front.pitch_inertia + difference * c * c,
        front.roll_inertia - difference * c * c, difference * c * s, front.yaw_inertia, turn, g,
    )  # fmt: skip
    r = lump(
        rear.mass,
        rear.x,
        0.0,
        rear.z,
        rear.roll_inertia,
        rear.pitch_inertia,
        0.0,
        rear.yaw_inertia,
        turn,
        g,
    )
    lr, high = g.rear_length, axle.height
    return Inertia(
        f.heave + r.heave + axle.mass,
        f.heave_pitch + r.heave_pitch + axle.mass * lr,
        f.heave_roll + r.heave_roll,
        f.pitch + r.pitch + axle.mass * (lr * lr + high * high),
        f.pitch_roll + r.pitch_roll,
        f.roll + r.roll,
        f.tipping + r.tipping,
    )


class Accelerance(NamedTuple):
    """Accelerations of heave [1/kg], pitch and roll [1/(kg m)] per newton of a load."""

    heave: float
    pitch: float
    roll: float


@inlined
def accelerance(i: Inertia, pitch: float, roll: float) -> Accelerance:
    """The accelerance of a load with these lever arms [m] in pitch and roll: a row of the inverse of the inertia, by cofactors."""
    p, q = (
        i.pitch * i.roll - i.pitch_roll * i.pitch_roll,
        i.heave_roll * i.pitch_roll - i.heave_pitch * i.roll,
    )
    r = i.heave_pitch * i.pitch_roll - i.heave_roll * i.pitch
    t = i.heave_pitch * i.heave_roll - i.heave * i.pitch_roll
    size = i.heave * p + i.heave_pitch * q + i.heave_roll * r
    return Accelerance(
        (p + q * pitch + r * roll) / size,
        (q + (i.heave * i.roll - i.heave_roll * i.heave_roll) * pitch + t * roll) / size,
        (r + t * pitch + (i.heave * i.pitch - i.heave_pitch * i.heave_pitch) * roll) / size,
    )


@compiled
def restoring_matrix(joint: Joint, m: LoadedMachine) -> RestoringMatrix:
    """The restoring matrix of a machine that is bent like this."""
    g, c, s = m.geometry, joint.cosine, joint.sine
    lf, lr, half = g.front_length, g.rear_length, g.front_track / 2.0
    x1, y1, x2, y2 = lf * c - half * s, lf * s + half * c, lf * c + half * s, lf * s - half * c
    k = m.prediction.tyre_stiffness
    i = inertia_of(joint, m)
    # The weight of a machine that rolls tips it further. lean: that moment per deflection and stiffness of a front tyre.
    lean = i.tipping / (g.front_track * (lf + lr * c) * k)
    a1 = accelerance(i, -x1, y1 - lean * (half * s + lf * c + lr))
    a2 = accelerance(i, -x2, y2 - lean * (half * s - lf * c - lr))
    a3 = accelerance(i, lr, lean * half * s)  # -2 half s, on two tyres
    return RestoringMatrix(
        k * (a1.heave - x1 * a1.pitch + y1 * a1.roll),
        k * (a2.heave - x1 * a2.pitch + y1 * a2.roll),
        k * (a3.heave - x1 * a3.pitch + y1 * a3.roll),
        k * (a1.heave - x2 * a1.pitch + y2 * a1.roll),
        k * (a2.heave - x2 * a2.pitch + y2 * a2.roll),
        k * (a3.heave - x2 * a3.pitch + y2 * a3.roll),
        2.0 * k * (a1.heave + lr * a1.pitch),
        2.0 * k * (a2.heave + lr * a2.pitch),
        2.0 * k * (a3.heave + lr * a3.pitch),
        2.0 * m.prediction.roll_damping / m.pitch_frequency,
    )


@inlined
def rocking_from(
    left: float,
    right: float,
    rear: float,
    left_rate: float,
    right_rate: float,
    forces: NormalForces,
    weight: float,
) -> Rocking:
    """How the machine rocks now.

    left, right, rear: loads of the front wheels and of both rear ones [N], beside the quasi-static `forces`; rates: of the front wheels'
    loads [N/s]; the rear wheels lose what they gain; weight: of the machine [N].
    """
    n, most, fastest = forces, WEIGHTS * weight, WEIGHTS_RATE * weight
    return Rocking(
        within(left - n.front_left, most), within(right - n.front_right, most),
        within(rear - n.rear_left - n.rear_right, most), within(left_rate, fastest), within(right_rate, fastest),
        within(-left_rate - right_rate, fastest), n.front_left, n.front_right, n.pivot,
    )  # fmt: skip


@inlined
def rocked(b: Rocking, forces: NormalForces, dt: float, w: RestoringMatrix) -> Rocking:
    """The machine `dt` [s] later on tyres that give way, while the quasi-static loads come to `forces`.

    An arm that starts in a tenth of a second is faster than the tyres: they see part of the push, and swing after it.
    """
    left = b.left - (forces.front_left - b.left_load)
    right = b.right - (forces.front_right - b.right_load)
    rear = b.rear - (forces.pivot - b.pivot_load)
    at_left, at_right = left + w.damping * b.left_rate, right + w.damping * b.right_rate
    at_rear = rear + w.damping * b.rear_rate
    left_rate = b.left_rate - (w.left_left * at_left + w.left_right * at_right + w.left_rear * at_rear) * dt
    right_rate = (
        b.right_rate - (w.right_left * at_left + w.right_right * at_right + w.right_rear * at_rear) * dt
    )
    rear_rate = b.rear_rate - (w.rear_left * at_left + w.rear_right * at_right + w.rear_rear * at_rear) * dt
    return Rocking(
        left + left_rate * dt, right + right_rate * dt, rear + rear_rate * dt, left_rate, right_rate, rear_rate,
        forces.front_left, forces.front_right, forces.pivot,
    )  # fmt: skip


@inlined
def with_rocking(n: NormalForces, b: Rocking) -> NormalForces:
    """The loads of the tyres; both rear wheels swing alike."""
    rear = b.rear / 2.0
    return NormalForces(
        n.front_left + b.left,
        n.front_right + b.right,
        n.pivot + b.rear,
        n.rear_left + rear,
        n.rear_right + rear,
    )
