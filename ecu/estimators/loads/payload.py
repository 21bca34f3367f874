"""Payload and force of a pile on the bucket, from the pressures of lift and tilt cylinders.

Two balances of moments: arm with bucket and load about the arm's pivot, bucket and load about the bucket's pin. Their
difference is the load's weight wherever it lies in the bucket; what is left of the second one says how far ahead of its usual
place it lies, as a couple. In a pile, payload and couple stand still and the two balances give the force on the cutting edge.
The machine is taken to be in a pile when both the pressures and the unexplained traction say so.
Holds while the arm moves evenly.
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.loads.cog import rotated
from ecu.estimators.loads.linkage import levers, pushes
from ecu.estimators.motion.arm import Turning, accelerating
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.estimators.quantities import Vector
from ecu.estimators.signals import Inputs
from ecu.estimators.state import State

LEAST_BASE = 0.05
"""Lever over the arm's length below which the force on the edge cannot be determined."""
EMPTY = 5e4
"""Pressure of a head side that carries nothing [Pa]."""
WEIGHED = 0.5
"""Share of its moment at rest that a load has to exert to be weighed: a machine that falls, or is thrown up, weighs nothing."""
LIGHTEST = -0.5
"""No bucket carries less than nothing: bound of the payload in masses of the empty bucket, with room for a calibration that is wrong."""
CALM = 1.0
"""How far back the payload is looked for when a pile begins: time constant [s]."""


class BucketLoad(NamedTuple):
    """Load on the bucket; x, z: force of a pile on the cutting edge, front frame's axes [N]."""

    payload: float  # [kg]
    couple: float  # about the bucket's pin, as of a load further ahead [N m]
    calm_payload: float  # both, following slowly
    calm_couple: float
    digging: float  # 1 while in a pile
    x: float
    z: float
    traction: float  # force ahead that the motion does not explain [N]


class Residual(NamedTuple):
    """What the cylinders carry besides arm and bucket: moment about the arm's pivot less that about the pin, and about the pin."""

    weight: float  # [N m]
    place: float  # [N m]
    tilt_weight: float  # the same per newton of the tilt cylinder's push [m]
    tilt_place: float


@compiled
def residual(i: Inputs, fx: float, fz: float, p: Parameters) -> Residual:
    """Moments of the cylinders less those of arm and bucket; fx, fz: specific force, front frame's axes [m/s2]."""
    arm, bucket = p.arm, p.bucket
    lever = levers(i.lift_arm_angle, i.tilt_angle, arm, bucket, p.cylinders, p.tilt_linkage)
    lifting, tilting = pushes(i.lift_pressure, i.tilt_pressure, p.cylinders, p.tilt_linkage)
    tilt_weight = lever.tilt_on_arm - lever.tilt_on_bucket
    ax, az = rotated(arm.along, arm.above, i.lift_arm_angle)
    px, pz = rotated(arm.length, 0.0, i.lift_arm_angle)
    bx, bz = rotated(bucket.forward, bucket.above, i.tilt_angle - bucket.carried)
    own = arm.mass * (ax * fz - az * fx) + bucket.mass * (px * fz - pz * fx)
    return Residual(
        lifting * lever.lift + tilting * tilt_weight - own,
        tilting * lever.tilt_on_bucket - bucket.mass * (bx * fz - bz * fx),
        tilt_weight,
        lever.tilt_on_bucket,
    )


@compiled
def weighs(i: Inputs, fx: float, fz: float, p: Parameters) -> bool:
    """Whether a load in the bucket exerts enough moment about the arm's pivot to be weighed."""
    px, pz = rotated(p.arm.length, 0.0, i.lift_arm_angle)
    return px * fz - pz * fx >= WEIGHED * px * GRAVITY


@compiled
def loaded(i: Inputs, r: Residual, fx: float, fz: float, p: Parameters) -> tuple[float, float]:
    """Payload [kg] and couple [N m] of a bucket that touches nothing and whose load `weighs`."""
    px, pz = rotated(p.arm.length, 0.0, i.lift_arm_angle)
    lx, lz = rotated(p.bucket.payload_forward, p.bucket.payload_above, i.tilt_angle - p.bucket.carried)
    lever = max(px * fz - pz * fx, WEIGHED * px * GRAVITY)
    payload = max(r.weight / lever, LIGHTEST * p.bucket.mass)
    return payload, r.place - payload * (lx * fz - lz * fx)


@compiled
def pushed(
    i: Inputs, r: Residual, payload: float, couple: float, traction: float, along: Vector, p: Parameters
) -> tuple[float, float]:
    """Force on the cutting edge (x, z) [N] beside a known payload and couple.

    With an empty head side the tilt cylinder pulls with an unknown force; the traction then stands in for it.
    None where the balances leave the force open.
    """
    fx, fz = along.x, along.z
    bucket = p.bucket
    px, pz = rotated(p.arm.length, 0.0, i.lift_arm_angle)
    lx, lz = rotated(bucket.payload_forward, bucket.payload_above, i.tilt_angle - bucket.carried)
    ex, ez = rotated(p.digging.edge_forward, p.digging.edge_above, i.tilt_angle - bucket.carried)
    weight = r.weight - payload * (px * fz - pz * fx)
    place = r.place - payload * (lx * fz - lz * fx) - couple
    least = LEAST_BASE * p.arm.length
    if i.tilt_pressure < EMPTY:
        a, b, x = r.tilt_weight, r.tilt_place, -traction
        base = b * px - a * ex
        if abs(base) < least * (abs(a) + abs(b)):
            return x, 0.0
        return x, (x * (b * pz - a * ez) - b * weight + a * place) / base
    base = pz * ex - px * ez
    if abs(base) < least * p.arm.length:
        return 0.0, 0.0
    return (ex * weight - px * place) / base, (ez * weight - pz * place) / base


@compiled
def followed_load(
    i: Inputs,
    s: State,
    r: Residual,
    along: Vector,
    traction: float,
    speed: float,
    lift: Turning,
    p: Parameters,
) -> BucketLoad:
    """One cycle: what the bucket carries and pushes; the last known without pressures.

    r: `residual` at `along`; along: specific force at the front unit, front frame's axes [m/s2]; traction: of all tyres less what the
    motion takes [N]; speed: of the rear axle [m/s].
    """
    if i.pressure_usable == 0.0:
        return BucketLoad(
            s.payload, s.couple, s.calm_payload, s.calm_couple, s.digging, s.push_x, s.push_z, s.traction
        )
    fresh, couple = loaded(i, r, along.x, along.z, p)
    if not weighs(i, along.x, along.z, p):
        fresh, couple = s.payload, s.couple
    if s.cycles == 0.0:
        return BucketLoad(fresh, couple, fresh, couple, 0.0, 0.0, 0.0, 0.0)
    d, dug = p.digging, s.digging != 0.0
    quick = i.dt / (d.settling_time + i.dt)
    unexplained = s.traction + quick * (traction - s.traction)
    # when digging begins, the filtered payload already holds some of the pile's force: use the slower one
    payload = s.payload if dug else s.calm_payload
    about = s.couple if dug else s.calm_couple
    x, z = pushed(i, r, payload, about, unexplained, along, p)
    x, z = s.push_x + quick * (x - s.push_x), s.push_z + quick * (z - s.push_z)
    least = 0.5 * d.force if dug else d.force
    if unexplained > least and (dug or (x < -least and abs(speed) < d.speed)):
        return BucketLoad(payload, about, s.calm_payload, s.calm_couple, 1.0, x, z, unexplained)
    share, calm = i.dt / (p.cylinders.settling_time + i.dt), i.dt / (CALM + i.dt)
    if i.tilt_pressure < EMPTY or accelerating(lift):
        share = 0.0
    elif dug:
        share = calm = 1.0  # what was dug stays on the bucket
    payload, about = s.payload + share * (fresh - s.payload), s.couple + share * (couple - s.couple)
    return BucketLoad(
        payload,
        about,
        s.calm_payload + calm * (payload - s.calm_payload),
        s.calm_couple + calm * (about - s.calm_couple),
        0.0,
        x,
        z,
        unexplained,
    )


@compiled
def standing_payload(i: Inputs, gravity: float, p: Parameters) -> float:
    """Payload [kg] of a machine that stands on level ground."""
    r = residual(i, 0.0, gravity, p)
    return loaded(i, r, 0.0, gravity, p)[0]


@compiled
def lift_acceleration(
    i: Inputs, r: Residual, along: Vector, load: BucketLoad, lift: Turning, p: Parameters
) -> float:
    """Angular acceleration of the lift arm [rad/s2] from the cylinders' forces, without delay.

    The moment that neither weight nor payload explains turns arm, bucket and load about the arm's pivot; the bucket keeps
    its angle to the frame. The tracked acceleration in a pile, and where the pressures do not say.
    """
    if i.pressure_usable == 0.0 or load.digging != 0.0 or i.tilt_pressure < EMPTY:
        return lift.acceleration
    arm = p.arm
    px, pz = rotated(arm.length, 0.0, i.lift_arm_angle)
    unexplained = r.weight - load.payload * (px * along.z - pz * along.x)
    about_pivot = arm.mass * (arm.along * arm.along + arm.above * arm.above) + arm.pitch_inertia
    carried = (p.bucket.mass + load.payload) * arm.length * arm.length
    return unexplained / (about_pivot + carried)


class Push(NamedTuple):
    """Force of a pile on the machine, with its couple, in the front frame's axes."""

    x: float  # [N]
    z: float
    ahead: float  # where it acts, from the joint [m]
    height: float
    couple: float  # [N m], as of a load further ahead


@compiled
def push_of(i: Inputs, load: BucketLoad, p: Parameters) -> Push:
    """What acts on the front unit beside weight; the force only while digging."""
    px, pz = rotated(p.arm.length, 0.0, i.lift_arm_angle)
    ex, ez = rotated(p.digging.edge_forward, p.digging.edge_above, i.tilt_angle - p.bucket.carried)
    return Push(
        load.x * load.digging,
        load.z * load.digging,
        p.arm.pivot_x + px + ex,
        p.arm.pivot_z + pz + ez,
        load.couple,
    )
