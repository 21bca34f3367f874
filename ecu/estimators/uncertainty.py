"""How far normal forces, load-transfer ratio and payload may be off: errors of the calibration and of sensors, propagated.

Every uncertain parameter moves the load and its moments about the joint; the three points of support share that as they share the load
itself, so each sensitivity is exact and costs a few products. Parameters are independent and drawn evenly within their tolerance, whose standard
deviation is the tolerance over the root of 3. To this comes what the estimate shows with the right calibration: noise, delay, what the
balance leaves out.

Arm and bucket: the cylinders' pressure weighs them together with the payload. Their errors go into the payload with the opposite sign, and
of the loads only the part that the arm's pivot bears remains.
What the payload gets wrong by the scale of the pressures and by the arm's angle moves the loads with it. Payload and push of a pile that have
not settled, and what a pile leaves open, are `ecu.estimators.loads.doubt`.
Not included: wheels on the axle's stop, tyre radii and stiffnesses (which act on the loads in the short run only).
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.loads.doubt import Doubt
from ecu.estimators.parameters import Geometry, Parameters
from ecu.estimators.quantities import NormalForces, Vector

ROOT = math.sqrt(3.0)
MASS = 0.03 / ROOT
"""Standard deviation of a part's mass by its data sheet [share]."""
PLACE = 0.05 / ROOT
"""Of a centre of gravity [m]."""
ACCELERATION = 0.05
"""Of the accelerometers' zero [m/s2]."""
PRESSURE = 0.0025
"""Of the scale of the cylinders' pressures."""
ANGLE = 0.006
"""Of the angle between the arm and the measured specific force [rad]: the sensor of the arm (0.2 degrees) and the accelerometers (0.3 degrees)."""
OWN_FRONT = 200.0
"""Of a front wheel's load with the right calibration [N]: RMS errors of 160 to 360 N in the drive cases with an empty bucket."""
OWN_REAR = 530.0
"""Of a rear wheel's: 310 to 560 N."""
OWN_SHIFT = 500.0
"""Of the difference between the loads of right and left wheels [N], while the articulation is held: 0.0025 to 0.0055 of all."""
STEERED = 0.023
"""Of the load-transfer ratio, per rate of the articulation [s/rad]: the filter of the angular accelerations lags while the machine is steered, and
so do the side force on the oscillation pivot and what it takes from one rear wheel to the other. On clean signals the error of the ratio falls from 0.008 to 0.005 without the filter."""
OWN_PAYLOAD = 9.0
"""Of the payload beside all that [kg]: an empty bucket's scatters by 1 to 5 kg, by 19 kg when the machine brakes hard."""
OWN_SHARE = 0.011
"""... and this share of it: 34 kg of 3204 kg."""


class Uncertainty(NamedTuple):
    """Standard deviations."""

    normal_1: float  # [N]
    normal_2: float
    normal_3: float
    normal_4: float
    load_transfer_ratio: float
    payload: float  # [kg]


class Spread(NamedTuple):
    """Variances that add up, parameter by parameter."""

    left: float  # of the front wheels and of one rear wheel [N2]
    right: float
    rear: float
    transfer: float  # of the load-transfer ratio


class Points(NamedTuple):
    """Where front wheels and rear pivot stand, and the share of the ratio that a newton is worth."""

    left_x: float  # from the rear pivot [m]
    left_y: float
    right_x: float
    right_y: float
    back: float  # from the joint to the pivot [m]
    total: float  # load of all wheels [N]
    ratio: float  # load-transfer ratio


@compiled
def points_of(angle: float, n: NormalForces, g: Geometry) -> Points:
    """The points of support at an articulation angle [rad], under these loads."""
    c, s, half = math.cos(angle), math.sin(angle), g.front_track / 2.0
    left, right = n.front_left + n.rear_left, n.front_right + n.rear_right
    return Points(
        g.rear_length + g.front_length * c - half * s,
        g.front_length * s + half * c,
        g.rear_length + g.front_length * c + half * s,
        g.front_length * s - half * c,
        g.rear_length,
        max(left + right, 1.0),
        (right - left) / max(left + right, 1.0),
    )


@compiled
def with_error(v: Spread, load: float, along: float, across: float, p: Points) -> Spread:
    """The variances with those of one more parameter, whose standard deviation moves the load [N] and its moments [N m].

    along: load times its distance ahead of the joint; across: to the left.
    """
    about_pivot = along + p.back * load
    area = p.left_x * p.right_y - p.right_x * p.left_y
    left = (about_pivot * p.right_y - p.right_x * across) / area
    right = (p.left_x * across - about_pivot * p.left_y) / area
    rear = (load - left - right) / 2.0
    transfer = (right - left - p.ratio * load) / p.total
    return Spread(
        v.left + left * left, v.right + right * right, v.rear + rear * rear, v.transfer + transfer * transfer
    )


@compiled
def with_lump(
    v: Spread, mass: float, x: float, y: float, z: float, c: float, s: float, f: Vector, p: Points
) -> Spread:
    """The variances with those of a lump's mass and place; c, s: of its frame's angle against the rear frame."""
    m, d = mass * MASS, mass * PLACE
    heavier = with_error(v, m * f.z, m * (x * f.z - z * f.x), m * (y * f.z - z * f.y), p)
    ahead = with_error(heavier, 0.0, d * c * f.z, d * s * f.z, p)
    return with_error(ahead, 0.0, -d * f.x, -d * f.y, p)


class Weighing(NamedTuple):
    """Variances of the payload [kg2]: errors that the loads share with it, and those that they do not."""

    shared: float  # scale of the pressures, angle of the arm
    apart: float  # arm and bucket weighed with it, and what the estimate shows with the right calibration


@compiled
def weighing(lift_angle: float, payload: float, lean: float, p: Parameters) -> Weighing:
    """How well the cylinders weigh; lean: specific force ahead over upwards, in the front frame's axes.

    The weight's lever about the arm's pivot is the pin's place ahead, less its height times the lean. An arm that lies low
    has a longer one while the machine brakes, and a change of its angle changes it more.
    """
    arm, bucket = p.arm, p.bucket
    c, s = math.cos(lift_angle), math.sin(lift_angle)
    lever = arm.length * (c - s * lean)
    centre = arm.along * (c - s * lean) - arm.above * (s + c * lean)
    weighed = (arm.mass * centre + (bucket.mass + max(payload, 0.0)) * lever) / lever
    share = OWN_SHARE * max(payload, 0.0)
    own = OWN_PAYLOAD * OWN_PAYLOAD + share * share
    arm_mass, bucket_mass = MASS * arm.mass * centre / lever, MASS * bucket.mass
    arm_place = PLACE * arm.mass * math.sqrt(1.0 + lean * lean) / lever
    scale, turned = PRESSURE * weighed, ANGLE * weighed * (s + c * lean) / (c - s * lean)
    return Weighing(
        scale * scale + turned * turned,
        own + arm_mass * arm_mass + arm_place * arm_place + bucket_mass * bucket_mass,
    )


@compiled
def with_bucket(
    v: Spread, shared: float, doubt: Doubt, fx: float, fz: float, c: float, s: float, p: Points
) -> Spread:
    """The variances with those of a payload that is off by `shared` [kg], and of a load or push that has not settled.

    fx, fz: specific force in the front frame's axes [m/s2]; c, s: of its angle against the rear frame.
    """
    heavier = shared * (doubt.ahead * fz - doubt.height * fx)
    known = with_error(v, shared * fz, heavier * c, heavier * s, p)
    pitching = doubt.pitching / ROOT
    return with_error(known, doubt.load / ROOT, pitching * c, pitching * s, p)


@compiled
def uncertainty(
    force: Vector,
    angle: float,
    rate: float,
    lift_angle: float,
    payload: float,
    n: NormalForces,
    doubt: Doubt,
    p: Parameters,
) -> Uncertainty:
    """Standard deviations of the estimates of one cycle.

    force: specific force at the machine's centre of gravity [m/s2]; angle, rate: of the articulation, lift_angle: of the arm [rad, rad/s].
    """
    c, s, at = math.cos(angle), math.sin(angle), points_of(angle, n, p.geometry)
    front, rear, arm = p.front, p.rear, p.arm
    fx, fz = force.x * c + force.y * s, max(force.z, 1.0)
    weighed = weighing(lift_angle, payload, fx / fz, p)
    own = OWN_SHIFT / at.total
    steered = STEERED * rate
    shifted = steered * at.total / 2.0
    v = Spread(0.0, 0.0, shifted * shifted, own * own + steered * steered)
    v = with_lump(v, front.mass, front.x * c, front.x * s, front.z, c, s, force, at)
    v = with_lump(v, rear.mass, rear.x, 0.0, rear.z, 1.0, 0.0, force, at)
    v = with_bucket(v, math.sqrt(weighed.shared), doubt, fx, fz, c, s, at)
    # what the payload does not take over of the arm's mass: its part on the pivot
    rest = MASS * arm.mass * (1.0 - arm.along / arm.length) * force.z
    v = with_error(v, rest, rest * arm.pivot_x * c, rest * arm.pivot_x * s, at)
    # a wrong zero acts on all that has mass, load and bucket at their height
    arm_height = arm.pivot_z + arm.along * math.sin(lift_angle) + arm.above * math.cos(lift_angle)
    leaning = front.mass * front.z + rear.mass * rear.z + arm.mass * arm_height
    leaning += (p.bucket.mass + max(payload, 0.0)) * doubt.height
    leaning *= ACCELERATION
    v = with_error(v, 0.0, -leaning, 0.0, at)
    v = with_error(v, 0.0, 0.0, -leaning, at)
    axle = MASS * p.axle.mass * force.z / 2.0
    # what a wrong lateral force at the pivot shifts between the rear wheels
    tipped = ACCELERATION * (front.mass + rear.mass) / 2.0 * p.geometry.pivot_height / p.geometry.rear_track
    behind = math.sqrt(v.rear + axle * axle + tipped * tipped + OWN_REAR * OWN_REAR)
    return Uncertainty(
        math.sqrt(v.left + OWN_FRONT * OWN_FRONT),
        math.sqrt(v.right + OWN_FRONT * OWN_FRONT),
        behind,
        behind,
        math.sqrt(v.transfer),
        math.sqrt(weighed.shared + weighed.apart + doubt.payload * doubt.payload / 3.0),
    )
