"""One tyre on a plane road: normal force, Magic Formula with combined slip, relaxation.

Forces act at the contact point in the wheel's plane. The moment about the axle is the longitudinal
force times the *effective* radius, as virtual work demands of a tyre that rolls without slip at
that radius; the pressure centre then lies slightly ahead of the contact point under drive.
Source: Pacejka, Tire and Vehicle Dynamics: Magic Formula (load, pressure and combined-slip terms
of MF-Tyre 5.2 and 6.1), single-contact-point transient model; effective radius by Andreev.
Left out: camber thrust, turn slip, rolling resistance, overturning moment, ply steer, conicity (plant/effects has some).
"""

import math

import numpy as np
from numpy.typing import NDArray

from plant.compiled import uncounted
from plant.physics.parameters import (
    W_ADDED_LOAD,
    W_ADDED_SLIDING_X,
    W_ADDED_SLIDING_Y,
    W_CARCASS_DAMPING,
    W_CARCASS_DAMPING_SPEED,
    W_DAMPING,
    W_LATERAL_STIFFNESS,
    W_LONGITUDINAL_STIFFNESS,
    W_NOMINAL_LOAD,
    W_PCX1,
    W_PCY1,
    W_PDX1,
    W_PDX2,
    W_PDY1,
    W_PDY2,
    W_PEX1,
    W_PEX2,
    W_PEX3,
    W_PEX4,
    W_PEY1,
    W_PEY2,
    W_PKX1,
    W_PKX2,
    W_PKX3,
    W_PKY1,
    W_PKY2,
    W_PPX1,
    W_PPX2,
    W_PPX3,
    W_PPX4,
    W_PPY1,
    W_PPY2,
    W_PPY3,
    W_PPY4,
    W_PRESSURE,
    W_QBZ1,
    W_QCZ1,
    W_QDZ1,
    W_QDZ2,
    W_QFZ1,
    W_QFZ2,
    W_RADIUS,
    W_RBX1,
    W_RBX2,
    W_RBY1,
    W_RBY2,
    W_RCX1,
    W_RCY1,
    W_REX1,
    W_SHORTEST_RELAXATION,
)
from plant.physics.state import (
    T_ALIGNING,
    T_DEFLECTION,
    T_KAPPA_RATE,
    T_LATERAL,
    T_LONGITUDINAL,
    T_NORMAL,
    T_ROLLING_RADIUS,
    T_SIDE_SLIP,
    T_SLIDING_X,
    T_SLIDING_Y,
    T_SLIP,
    T_TAN_ALPHA_RATE,
    T_WRENCH,
)

Array = NDArray[np.float64]

SLOWEST = 0.1  # smallest speed by which a sliding velocity is divided for the reported slip [m/s]
UPRIGHT = 0.2  # cosine of the lean below which a wheel lies on its side and has no defined contact


@uncounted
def magic_formula(slip: float, stiffness: float, shape: float, peak: float, curvature: float) -> float:
    """Force [N]: D sin(C atan(Bx - E (Bx - atan Bx))) with B = K/(C D)."""
    bx = stiffness / (shape * peak) * slip
    return peak * math.sin(shape * math.atan(bx - curvature * (bx - math.atan(bx))))


@uncounted
def magic_slope(slip: float, stiffness: float, shape: float, peak: float, curvature: float) -> float:
    """Derivative of the Magic Formula by the slip [N]."""
    bx = stiffness / (shape * peak) * slip
    inner = bx - curvature * (bx - math.atan(bx))
    slope = stiffness * math.cos(shape * math.atan(inner)) / (1.0 + inner * inner)
    return slope * (1.0 - curvature + curvature / (1.0 + bx * bx))


@uncounted
def weight(slip: float, steepness: float, shape: float, curvature: float) -> float:
    """Combined-slip weight G of a force by the other slip: cos(C atan(Bx - E (Bx - atan Bx)))."""
    bx = steepness * slip
    return math.cos(shape * math.atan(bx - curvature * (bx - math.atan(bx))))


@uncounted
def plain_weight(slip: float, steepness: float, shape: float) -> float:
    """The same without curvature: cos(C atan(Bx))."""
    return math.cos(shape * math.atan(steepness * slip))


@uncounted
def radial_force(w: Array, deflection: float, rate: float) -> float:
    """Force of the tyre's radial spring and damper [N]; never pulls."""
    if deflection <= 0.0:
        return 0.0
    d = deflection / w[W_RADIUS]
    force = w[W_NOMINAL_LOAD] * (w[W_QFZ1] * d + w[W_QFZ2] * d * d) + w[W_DAMPING] * rate + w[W_ADDED_LOAD]
    return max(force, 0.0)


@uncounted
def effective_radius(loaded: float, unloaded: float) -> float:
    """Effective rolling radius from the loaded radius [m]: 3r/(1 + 2r/R0)."""
    return 3.0 * loaded / (1.0 + 2.0 * loaded / unloaded)


@uncounted
def stiffness_and_peak(w: Array, friction: float, load: float) -> tuple[float, float, float, float]:
    """Longitudinal [N] and cornering [N/rad] stiffness, longitudinal and lateral peak [N], at a load > 0.

    w: wheel block; friction: scale of the peaks.
    """
    nominal, dp = w[W_NOMINAL_LOAD], w[W_PRESSURE]
    df = load / nominal - 1.0
    stiffness_x = load * (w[W_PKX1] + w[W_PKX2] * df) * math.exp(w[W_PKX3] * df)
    stiffness_x *= 1.0 + w[W_PPX1] * dp + w[W_PPX2] * dp * dp
    z = load / (w[W_PKY2] * (1.0 + w[W_PPY2] * dp) * nominal)
    stiffness_y = w[W_PKY1] * (1.0 + w[W_PPY1] * dp) * nominal * 2.0 * z / (1.0 + z * z)  # sin(2 atan z)
    peak_x = friction * load * (w[W_PDX1] + w[W_PDX2] * df) * (1.0 + w[W_PPX3] * dp + w[W_PPX4] * dp * dp)
    peak_y = friction * load * (w[W_PDY1] + w[W_PDY2] * df) * (1.0 + w[W_PPY3] * dp + w[W_PPY4] * dp * dp)
    return stiffness_x, stiffness_y, peak_x, peak_y


@uncounted
def curvatures(w: Array, load: float, kappa: float) -> tuple[float, float]:
    """Curvature factors of the longitudinal and the lateral curve at a load, at most 1; PEX4 is the difference of driving and braking."""
    df = load / w[W_NOMINAL_LOAD] - 1.0
    along = w[W_PEX1] + w[W_PEX2] * df + w[W_PEX3] * df * df
    along *= 1.0 - math.copysign(w[W_PEX4], kappa)
    return min(along, 1.0), min(w[W_PEY1] + w[W_PEY2] * df, 1.0)


@uncounted
def combined_forces(
    w: Array, load: float, curve: tuple[float, float, float, float], kappa: float, tan_alpha: float
) -> tuple[float, float, float]:
    """Longitudinal and lateral force [N] and aligning moment [N m] in steady slip, rolling forwards.

    curve: stiffnesses and peaks at this load; kappa positive driving; tan_alpha positive when the
    lateral force is (against ISO's slip angle).
    """
    stiffness_x, stiffness_y, peak_x, peak_y = curve
    curvature_x, curvature_y = curvatures(w, load, kappa)
    pure_x = magic_formula(kappa, stiffness_x, w[W_PCX1], peak_x, curvature_x)
    pure_y = magic_formula(tan_alpha, stiffness_y, w[W_PCY1], peak_y, curvature_y)
    narrowing_x = w[W_RBX2] * kappa
    narrowing_y = w[W_RBY2] * tan_alpha
    along = pure_x * weight(tan_alpha, w[W_RBX1] / math.sqrt(1.0 + narrowing_x**2), w[W_RCX1], w[W_REX1])
    across = pure_y * plain_weight(kappa, w[W_RBY1] / math.sqrt(1.0 + narrowing_y**2), w[W_RCY1])
    ratio = stiffness_x / stiffness_y * kappa
    equivalent = math.sqrt(tan_alpha * tan_alpha + ratio * ratio)
    nominal = w[W_NOMINAL_LOAD]
    trail = load * w[W_RADIUS] / nominal * (w[W_QDZ1] + w[W_QDZ2] * (load / nominal - 1.0))
    trail *= max(plain_weight(equivalent, w[W_QBZ1], w[W_QCZ1]), 0.0)  # none left in full sliding
    return along, across, -trail * across


@uncounted
def sense_of_travel(w: Array, speed: float) -> float:
    """1 rolling forwards, -1 backwards: the lateral force acts behind the middle of the contact, seen in the direction of travel.

    speed: V_x [m/s]. Source: Pacejka, Tire and Vehicle Dynamics, brush model of chapter 3: the tread's deflection grows from the leading
    edge. Below walking speed the sign fades out by a quarter of a sine, so that the moment has no kink.
    """
    whole = w[W_CARCASS_DAMPING_SPEED]
    if abs(speed) < whole:
        return math.sin(0.5 * math.pi * speed / whole)
    return math.copysign(1.0, speed)


@uncounted
def relax(slip: float, speed: float, sliding: float, length: float, ahead: float) -> float:
    """Rate of a transient slip [1/s]: length d(slip)/dt + |speed| slip = -sliding.

    Regular at standstill, where it is the deflection of the carcass. `ahead` is the step [s] over
    which the rate is implicit in the slip, 0 for the derivative itself. A wheel that spins while
    the machine stands winds up to slip 1, not without end.
    """
    rate = (-sliding - speed * slip) / (length + ahead * speed)
    if abs(slip) > 1.0 + 10.0 * speed and slip * rate > 0.0:
        return 0.0
    return rate


@uncounted
def tyre_forces(
    w: Array,
    friction: float,
    load: float,
    speed: float,
    sliding_x: float,
    sliding_y: float,
    kappa: float,
    tan_alpha: float,
    ahead: float,
    out: Array,
) -> None:
    """Forces in the road plane and rates of the transient slips, into `out`.

    speed: |V_x| [m/s]; sliding_x, sliding_y: velocity of the contact patch over the road [m/s];
    kappa, tan_alpha: transient slips now; the forces belong to the slips `ahead` seconds later.
    """
    shortest = w[W_SHORTEST_RELAXATION]
    if load <= 0.0:
        out[T_KAPPA_RATE] = relax(kappa, speed, sliding_x, shortest, ahead)
        out[T_TAN_ALPHA_RATE] = relax(tan_alpha, speed, sliding_y, shortest, ahead)
        out[T_LONGITUDINAL] = out[T_LATERAL] = out[T_ALIGNING] = 0.0
        return
    curve = stiffness_and_peak(w, friction, load)
    stiffness_x, stiffness_y, peak_x, peak_y = curve
    curvature_x, curvature_y = curvatures(w, load, kappa)
    # relaxation length = slope of the curve over the stiffness of the carcass: it falls with slip, as measured on tyres
    length_x = magic_slope(kappa, stiffness_x, w[W_PCX1], peak_x, curvature_x) / w[W_LONGITUDINAL_STIFFNESS]
    length_y = magic_slope(tan_alpha, stiffness_y, w[W_PCY1], peak_y, curvature_y) / w[W_LATERAL_STIFFNESS]
    out[T_KAPPA_RATE] = relax(kappa, speed, sliding_x, max(length_x, shortest), ahead)
    out[T_TAN_ALPHA_RATE] = relax(tan_alpha, speed, sliding_y, max(length_y, shortest), ahead)
    kappa += ahead * out[T_KAPPA_RATE]
    tan_alpha += ahead * out[T_TAN_ALPHA_RATE]
    # At standstill the transient slip is an undamped spring of the carcass: the machine would rock for minutes. Damping fades in below
    # walking speed, by a half cosine so that the force has no kink.
    if speed < w[W_CARCASS_DAMPING_SPEED]:
        share = 0.5 + 0.5 * math.cos(math.pi * speed / w[W_CARCASS_DAMPING_SPEED])
        kappa -= share * w[W_CARCASS_DAMPING] * sliding_x / stiffness_x
        tan_alpha -= share * w[W_CARCASS_DAMPING] * sliding_y / stiffness_y
    out[T_LONGITUDINAL], out[T_LATERAL], out[T_ALIGNING] = combined_forces(w, load, curve, kappa, tan_alpha)


@uncounted
def wheel_contact(
    w: Array,
    friction: float,
    rise: float,
    centre: Array,
    height: float,
    axle: Array,
    normal: Array,
    motion: Array,
    kappa: float,
    tan_alpha: float,
    ahead: float,
    out: Array,
) -> None:
    """Everything one tyre does at the present state of its wheel, into `out` (T_OUTPUTS values).

    rise: speed at which the ground comes up under the tyre [m/s]; centre: wheel centre from the origin
    [m]; height: of the centre above the ground [m]; axle: unit vector to the left along the axle; normal: unit road normal; motion: angular velocity [rad/s] of
    the wheel including its spin, then velocity [m/s] of its point at the origin. All vectors in one
    right-handed set of axes, any; the wrench comes out in the same.
    """
    ax, ay, az = axle[0], axle[1], axle[2]
    nx, ny, nz = normal[0], normal[1], normal[2]
    # wheel heading in the road plane
    hx, hy, hz = ay * nz - az * ny, az * nx - ax * nz, ax * ny - ay * nx
    upright = math.sqrt(hx * hx + hy * hy + hz * hz)  # cosine of the lean
    for i in range(T_SLIDING_Y + 1):
        out[i] = 0.0
    if upright < UPRIGHT:
        out[T_ROLLING_RADIUS] = w[W_RADIUS]
        return
    hx, hy, hz = hx / upright, hy / upright, hz / upright
    # across the wheel in the road plane, and up in the wheel plane
    sx, sy, sz = ny * hz - nz * hy, nz * hx - nx * hz, nx * hy - ny * hx
    ux, uy, uz = hy * az - hz * ay, hz * ax - hx * az, hx * ay - hy * ax

    loaded = height / upright
    deflection = w[W_RADIUS] - loaded
    rolling = effective_radius(min(loaded, w[W_RADIUS]), w[W_RADIUS])
    px, py, pz = centre[0] - loaded * ux, centre[1] - loaded * uy, centre[2] - loaded * uz  # contact point
    ox, oy, oz = motion[0], motion[1], motion[2]
    vx, vy, vz = motion[3] + oy * pz - oz * py, motion[4] + oz * px - ox * pz, motion[5] + ox * py - oy * px
    spin = ox * ax + oy * ay + oz * az
    speed = vx * hx + vy * hy + vz * hz + loaded * spin  # of the wheel centre, along the heading
    sliding_x = speed - rolling * spin + w[W_ADDED_SLIDING_X]
    sliding_y = vx * sx + vy * sy + vz * sz + w[W_ADDED_SLIDING_Y]
    rising = vx * nx + vy * ny + vz * nz
    # the spring acts in the wheel plane; the component across it is carried by the lateral stiffness of the carcass
    load = radial_force(w, deflection, (rise - rising) / upright) / upright
    tyre_forces(w, friction, load, abs(speed), sliding_x, sliding_y, kappa, tan_alpha, ahead, out)

    out[T_ALIGNING] *= sense_of_travel(w, speed)

    along, across, aligning = out[T_LONGITUDINAL], out[T_LATERAL], out[T_ALIGNING]
    fx = load * nx + along * hx + across * sx
    fy = load * ny + along * hy + across * sy
    fz = load * nz + along * hz + across * sz
    about_axle = -(rolling - loaded) * along
    out[T_WRENCH] = py * fz - pz * fy + aligning * nx + about_axle * ax
    out[T_WRENCH + 1] = pz * fx - px * fz + aligning * ny + about_axle * ay
    out[T_WRENCH + 2] = px * fy - py * fx + aligning * nz + about_axle * az
    out[T_WRENCH + 3], out[T_WRENCH + 4], out[T_WRENCH + 5] = fx, fy, fz
    out[T_NORMAL] = load
    out[T_DEFLECTION] = deflection
    out[T_SLIP] = -sliding_x / max(abs(speed), SLOWEST)
    out[T_SIDE_SLIP] = sliding_y / max(abs(speed), SLOWEST)
    out[T_ROLLING_RADIUS] = rolling
    out[T_SLIDING_X] = sliding_x
    out[T_SLIDING_Y] = sliding_y
