"""Tilt of the machine on its tyres: wheel loads that follow the gyro between two balances of forces.

The balance of forces needs angular accelerations, which the gyro gives only late and noisily. The tyres
are springs: their loads change with the tilt of the machine, and the tilt's rate is the gyro's
own reading. So loads follow the gyro in the short run and the balance in the long run (a complementary
filter with the gyro's bias as a state), and are carried ahead by the time that sensor and bus need.

Tilt is that of the rear frame against the road: roll left up, pitch nose down [rad]; 0 where all tyres
are deflected alike. Front wheels and the oscillation pivot are the three points that it moves.
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.joint import Joint
from ecu.estimators.parameters import Contact, Geometry, Wheel
from ecu.estimators.quantities import NormalForces
from ecu.estimators.tyres.tyre import deflection, radial_stiffness

FORESEEN = 15.0
"""The prior of the gyro's bias, zero, weighs as much as this many cycles of measurement."""

CONTRADICTION = 0.02
"""Angle between the tilt by the balance and the tilt by the gyro [rad] beyond which the gyro's is dropped: 15 kN of a front tyre.

In 27 random drives with levers, turns and slopes, half of them with a wrong calibration, it was 0.017 at most while all wheels were down. Over a
kerb the road tilts under the machine, which the gyro takes for a tilt on the tyres: 0.08.
"""


class Tilt(NamedTuple):
    """Angles of the rear frame against the road, their rates, or the gyro's biases, about x and y."""

    roll: float
    pitch: float


class Springs(NamedTuple):
    """Tangent stiffness of the front left, front right and of one rear tyre [N/m]."""

    left: float
    right: float
    rear: float


@compiled
def springs(forces: NormalForces, wheel: Wheel) -> Springs:
    """Stiffness of the tyres under their loads; that of a lifted one is what it begins with."""
    rear = (forces.rear_left + forces.rear_right) / 2.0
    return Springs(
        radial_stiffness(forces.front_left, wheel.front_stiffening, wheel),
        radial_stiffness(forces.front_right, wheel.front_stiffening, wheel),
        radial_stiffness(rear, wheel.rear_stiffening, wheel),
    )


@compiled
def tilt_of(forces: NormalForces, joint: Joint, wheel: Wheel, geometry: Geometry) -> Tilt:
    """The tilt at which the tyres carry these loads."""
    c, s = joint.cosine, joint.sine
    lf, lr = geometry.front_length, geometry.rear_length
    left = deflection(forces.front_left, wheel.front_stiffening, wheel)
    right = deflection(forces.front_right, wheel.front_stiffening, wheel)
    mean = (forces.rear_left + forces.rear_right) / 2.0
    across = (right - left) / geometry.front_track
    along = (left + right) / 2.0 - deflection(mean, wheel.rear_stiffening, wheel)
    base = lf + lr * c
    roll = ((lr + lf * c) * across - s * along) / base
    return Tilt(roll, (lf * s * across + c * along) / base)


@compiled
def shifted(
    forces: NormalForces, change: Tilt, joint: Joint, stiffness: Springs, geometry: Geometry
) -> NormalForces:
    """Forces after a small change of tilt at the same total load."""
    c, s = joint.cosine, joint.sine
    lf, lr = geometry.front_length, geometry.rear_length
    across = geometry.front_track * (change.roll * c + change.pitch * s)
    along = change.pitch * (lr + lf * c) - change.roll * lf * s
    left, right, rear = stiffness
    # the rear pair comes down by so much less than the middle of the front pair, one side by so much more
    # than the other, and the total load stays
    middle = ((left - right) * across / 2.0 + 2.0 * rear * along) / (left + right + 2.0 * rear)
    behind = rear * (middle - along)
    return NormalForces(
        forces.front_left + left * (middle - across / 2.0),
        forces.front_right + right * (middle + across / 2.0),
        forces.pivot + 2.0 * behind,
        forces.rear_left + behind,
        forces.rear_right + behind,
    )


@compiled
def stands(forces: NormalForces) -> bool:
    """Whether every tyre is loaded, so that its deflection follows from its load."""
    return min(forces.front_left, forces.front_right, forces.rear_left, forces.rear_right) > 0.0


class Followed(NamedTuple):
    """Tilt, the gyro's biases, the tilt's rate after them, and by how much the balance contradicts the gyro."""

    tilt: Tilt
    bias: Tilt
    rate: Tilt
    innovation: Tilt  # tilt by the balance of forces less the tilt by the gyro; 0 where they are not compared


@compiled
def carried_on(tilt: Tilt, bias: Tilt, gyro: Tilt, yaw_rate: float, dt: float) -> Followed:
    """The tilt `dt` [s] later by the gyro alone; the biases stay. Arguments as in `followed`."""
    roll_rate = gyro.roll - bias.roll + yaw_rate * tilt.pitch
    pitch_rate = gyro.pitch - bias.pitch - yaw_rate * tilt.roll
    moved = Tilt(tilt.roll + roll_rate * dt, tilt.pitch + pitch_rate * dt)
    return Followed(moved, bias, Tilt(roll_rate, pitch_rate), Tilt(0.0, 0.0))


@compiled
def contradicts(innovation: Tilt) -> bool:
    """Whether balance and gyro differ by more than a machine on its tyres explains."""
    return max(abs(innovation.roll), abs(innovation.pitch)) > CONTRADICTION


@compiled
def followed(
    tilt: Tilt,
    bias: Tilt,
    gyro: Tilt,
    yaw_rate: float,
    balanced: Tilt,
    cycles: float,
    dt: float,
    contact: Contact,
) -> Followed:
    """One cycle of the filter.

    gyro: roll and pitch rate as read [rad/s]; balanced: tilt by the balance of forces; cycles: how many
    there were before. The first cycles weigh all they have seen alike (the least-squares line through
    them), so that the gyro's bias is known after a second.

    Where both contradict each other the tilt starts anew from the balance, and the bias learns nothing: else the tilt of
    a road would pass for a bias, and the loads would be wrong for seconds after a kerb.
    """
    on = carried_on(tilt, bias, gyro, yaw_rate, dt)
    roll, pitch = on.tilt.roll, on.tilt.pitch
    roll_error, pitch_error = balanced.roll - roll, balanced.pitch - pitch
    innovation = Tilt(roll_error, pitch_error)
    if contradicts(innovation):
        return Followed(balanced, bias, on.rate, innovation)
    seen = cycles + FORESEEN
    share = max(dt / (contact.settling_time + dt), 2.0 * (2.0 * seen - 1.0) / (seen * (seen + 1.0)))
    learnt = max(share / (contact.bias_time + dt), 6.0 / (seen * (seen + 1.0) * dt))
    return Followed(
        Tilt(roll + share * roll_error, pitch + share * pitch_error),
        Tilt(bias.roll - learnt * roll_error, bias.pitch - learnt * pitch_error),
        on.rate,
        innovation,
    )


@compiled
def carried(
    forces: NormalForces,
    tilt: Tilt,
    rate: Tilt,
    joint: Joint,
    dt: float,
    wheel: Wheel,
    geometry: Geometry,
    contact: Contact,
) -> NormalForces:
    """Forces of the tyres at the followed tilt, carried ahead by the latency, damping included.

    The sum over samples is half a cycle ahead of them already.
    """
    stiffness = springs(forces, wheel)
    known = tilt_of(forces, joint, wheel, geometry)
    lead = contact.latency - dt / 2.0 + contact.damping / ((stiffness.left + stiffness.right) / 2.0)
    change = Tilt(
        tilt.roll + rate.roll * lead - known.roll,
        tilt.pitch + rate.pitch * lead - known.pitch,
    )
    return shifted(forces, change, joint, stiffness, geometry)


@compiled
def load_rates(
    forces: NormalForces, rate: Tilt, joint: Joint, wheel: Wheel, geometry: Geometry
) -> tuple[float, float]:
    """How fast the machine's tilting loads the front left and the front right wheel [N/s]; the rear ones lose what both gain."""
    then = shifted(forces, rate, joint, springs(forces, wheel), geometry)
    return then.front_left - forces.front_left, then.front_right - forces.front_right
