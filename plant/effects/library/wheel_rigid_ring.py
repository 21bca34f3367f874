"""The tyre's belt as a rigid ring on the sidewalls.

Per wheel the belt moves against the rim ahead, across and up, and winds up about the axle; in camber and in yaw it goes with the rim. The
contact patch hangs on the belt by what is left of the tyre's compliance, so that at rest, and for slow changes, the tyre is the plain one.
Own states per wheel: displacement of the belt (3) [m] and its rate against the rim (3) [m/s], both in the rear frame's axes, wind-up [rad] and its rate.
A ring that has not moved yet passes on what the contact gives: so the machine finds its rest. The name puts it behind every
effect that raises the ground.
"""

import math
from collections.abc import Mapping

import numpy as np

from configuration import ConfigurationError
from plant.compiled import uncounted
from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import heading, lean, pressed, push, spin, twist
from plant.physics.parameters import (
    P_GRAVITY,
    W_ADDED_SLIDING_X,
    W_ADDED_SLIDING_Y,
    W_LATERAL_STIFFNESS,
    W_LONGITUDINAL_STIFFNESS,
    W_MASS,
    W_NOMINAL_LOAD,
    W_QFZ1,
    W_QFZ2,
    W_RADIUS,
    W_SPIN,
)
from plant.physics.state import G_HEIGHT, G_RISE, REAR_FRAME, T_WRENCH, WHEEL
from plant.physics.tyre import effective_radius
from plant.physics.workspace import Workspace
from plant.sheets.machine import Machine

PER_WHEEL = 8
LEAST_SHARE = (
    0.05  # of a tyre's stiffness that the contact patch keeps for itself, else the sidewall is too soft
)

MASS, INERTIA, IN_PLANE, LATERAL, WIND_UP, DAMPING = range(6)


@uncounted
def stiffness(q: Array) -> tuple[float, float, float]:
    """Of the sidewalls in the wheel's plane and across it [N/m], and in wind-up [N m/rad]."""
    turns = 4.0 * math.pi**2
    return (
        turns * q[MASS] * q[IN_PLANE] ** 2,
        turns * q[MASS] * q[LATERAL] ** 2,
        turns * q[INERTIA] * q[WIND_UP] ** 2,
    )


@uncounted
def belt(state: Array, own: int) -> tuple[float, float, float, float, float, float]:
    """Where a belt is against its rim [m] and how it moves against it [m/s]."""
    return (
        state[own],
        state[own + 1],
        state[own + 2],
        state[own + 3],
        state[own + 4],
        state[own + 5],
    )


@uncounted
def moved(state: Array, own: int) -> bool:
    """Whether a ring has moved against its rim."""
    for i in range(3, 6):
        if state[own + i] != 0.0:
            return True
    return state[own + 7] != 0.0


@uncounted
def in_series(w: Array, pressed_in: float, sidewall: float) -> float:
    """Deflection of the whole plain tyre [m] whose contact patch is pressed in by this much, less what its load pushes the belt up.

    From rho - F(rho)/k = patch, F the plain tyre's spring.
    """
    linear = w[W_NOMINAL_LOAD] * w[W_QFZ1] / w[W_RADIUS] / sidewall
    square = w[W_NOMINAL_LOAD] * w[W_QFZ2] / w[W_RADIUS] ** 2 / sidewall
    if pressed_in <= 0.0:
        return pressed_in
    root = max((1.0 - linear) ** 2 - 4.0 * square * pressed_in, 0.0)
    return 2.0 * pressed_in / (1.0 - linear + math.sqrt(root))


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """The contact patch is where the belt is, and slides as the belt moves. The belt's mass counts with the machine's."""
    own, w, centre, whole = x + PER_WHEEL * wheel, work.local[wheel], work.places.centres[wheel], work.whole
    whole[0] += q[MASS]
    for i in range(3):
        whole[1 + i] += q[MASS] / whole[0] * (centre[i] - whole[1 + i])
    if not moved(state, own):
        return
    n = work.normal
    hx, hy, hz, sx, sy, sz = heading(work, wheel)
    dx, dy, dz, vx, vy, vz = belt(state, own)
    upright = math.sqrt(max(1.0 - lean(work, wheel) ** 2, 1e-9))
    of_rim = pressed(state, p, work, wheel)
    of_belt = of_rim - (dx * n[0] + dy * n[1] + dz * n[2]) / upright
    sidewall, _, _ = stiffness(q)
    whole_tyre = in_series(w, of_belt, sidewall)
    work.ground[wheel, G_HEIGHT] += (whole_tyre - of_rim) * upright
    work.ground[wheel, G_RISE] -= vx * n[0] + vy * n[1] + vz * n[2]
    rolling = effective_radius(min(w[W_RADIUS] - whole_tyre, w[W_RADIUS]), w[W_RADIUS])
    w[W_ADDED_SLIDING_X] += vx * hx + vy * hy + vz * hz - rolling * state[own + 7]
    w[W_ADDED_SLIDING_Y] += vx * sx + vy * sy + vz * sz


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """What the contact gives goes to the belt; the rim gets it from the sidewalls."""
    own, body, rate = x + PER_WHEEL * wheel, WHEEL + wheel, work.rate
    c, a, up = work.places.centres[wheel], work.places.axles[wheel], work.places.world[2]
    weight = q[MASS] * p[P_GRAVITY]  # carried as in the plain wheel: the sidewalls' rest length allows for it
    push(work, body, c[0], c[1], c[2], -weight * up[0], -weight * up[1], -weight * up[2])
    turn = work.tree.motion[body]
    momentum = -q[INERTIA] * (spin(work, wheel) + state[own + 7])
    gx, gy, gz = (
        turn[1] * a[2] - turn[2] * a[1],
        turn[2] * a[0] - turn[0] * a[2],
        turn[0] * a[1] - turn[1] * a[0],
    )
    twist(work, body, momentum * gx, momentum * gy, momentum * gz)

    out = work.tyres[wheel]
    fx, fy, fz = out[T_WRENCH + 3], out[T_WRENCH + 4], out[T_WRENCH + 5]
    dx, dy, dz, vx, vy, vz = belt(state, own)
    bx, by, bz = c[0] + dx, c[1] + dy, c[2] + dz
    mx = out[T_WRENCH] - (by * fz - bz * fy)
    my = out[T_WRENCH + 1] - (bz * fx - bx * fz)
    mz = out[T_WRENCH + 2] - (bx * fy - by * fx)
    about = mx * a[0] + my * a[1] + mz * a[2]

    in_plane, lateral, wind_up = stiffness(q)
    slow = 2.0 * q[DAMPING]
    damp, damp_lateral = slow * math.sqrt(in_plane * q[MASS]), slow * math.sqrt(lateral * q[MASS])
    torque = wind_up * state[own + 6] + slow * math.sqrt(wind_up * q[INERTIA]) * state[own + 7]
    off, slip = dx * a[0] + dy * a[1] + dz * a[2], vx * a[0] + vy * a[1] + vz * a[2]
    across = (lateral - in_plane) * off + (damp_lateral - damp) * slip
    kx = in_plane * dx + damp * vx + across * a[0]
    ky = in_plane * dy + damp * vy + across * a[1]
    kz = in_plane * dz + damp * vz + across * a[2]
    mass, inertia = q[MASS], q[INERTIA]
    rate[own + 3], rate[own + 4], rate[own + 5] = (fx - kx) / mass, (fy - ky) / mass, (fz - kz) / mass
    rate[own + 7] = (about - torque) / inertia
    if not moved(state, own):
        return
    push(work, body, 0.0, 0.0, 0.0, -fx, -fy, -fz)
    twist(work, body, -out[T_WRENCH], -out[T_WRENCH + 1], -out[T_WRENCH + 2])
    push(work, body, c[0], c[1], c[2], kx, ky, kz)
    mx += dy * kz - dz * ky
    my += dz * kx - dx * kz
    mz += dx * ky - dy * kx
    rest = torque - (mx * a[0] + my * a[1] + mz * a[2])
    twist(work, body, mx + rest * a[0], my + rest * a[1], mz + rest * a[2])


@uncounted
def states(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """The rings against their rims, whose accelerations are known now."""
    ahead, up = work.ahead[0], work.places.world[2]
    o = work.tree.motion[REAR_FRAME]
    for wheel in range(4):
        own, rate = x + PER_WHEEL * wheel, work.rate
        m, b, c = (
            work.tree.motion[WHEEL + wheel],
            work.tree.acceleration[WHEEL + wheel],
            work.places.centres[wheel],
        )
        a = work.places.axles[wheel]
        ux, uy, uz = (
            m[3] + m[1] * c[2] - m[2] * c[1],
            m[4] + m[2] * c[0] - m[0] * c[2],
            m[5] + m[0] * c[1] - m[1] * c[0],
        )
        dx, dy, dz, vx, vy, vz = belt(state, own)
        fall = p[P_GRAVITY]
        rate[own + 3] -= (
            b[3] + b[1] * c[2] - b[2] * c[1] + m[1] * uz - m[2] * uy - fall * up[0] + o[1] * vz - o[2] * vy
        )
        rate[own + 4] -= (
            b[4] + b[2] * c[0] - b[0] * c[2] + m[2] * ux - m[0] * uz - fall * up[1] + o[2] * vx - o[0] * vz
        )
        rate[own + 5] -= (
            b[5] + b[0] * c[1] - b[1] * c[0] + m[0] * uy - m[1] * ux - fall * up[2] + o[0] * vy - o[1] * vx
        )
        rate[own + 7] -= b[0] * a[0] + b[1] * a[1] + b[2] * a[2]
        rate[own] = vx + ahead * rate[own + 3] - (o[1] * dz - o[2] * dy)
        rate[own + 1] = vy + ahead * rate[own + 4] - (o[2] * dx - o[0] * dz)
        rate[own + 2] = vz + ahead * rate[own + 5] - (o[0] * dy - o[1] * dx)
        rate[own + 6] = state[own + 7] + ahead * rate[own + 7]


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """The rim is the wheel without its belt; the contact patch keeps the compliance that the sidewalls do not have."""
    values = np.array(tuple(q.values()))
    in_plane, lateral, wind_up = stiffness(values)
    for block in wheel_blocks(p):
        for index, name, unit in ((W_MASS, "belt_mass_kg", "kg"), (W_SPIN, "belt_inertia_kg_m2", "kg m2")):
            if q[name] >= block[index]:
                raise ConfigurationError(
                    f"wheel_rigid_ring.{name} = {q[name]:g} {unit} is not less than the wheel's own {block[index]:g} {unit}"
                )
            block[index] -= q[name]
        along, across = 1.0 / in_plane + block[W_RADIUS] ** 2 / wind_up, 1.0 / lateral
        for index, taken, name in (
            (W_LONGITUDINAL_STIFFNESS, along, "longitudinal"),
            (W_LATERAL_STIFFNESS, across, "lateral"),
        ):
            left = 1.0 / block[index] - taken
            if left * block[index] < LEAST_SHARE:
                raise ConfigurationError(
                    f"wheel_rigid_ring: the ring's frequencies leave the contact patch no compliance of the tyre's {name} "
                    f"stiffness, {block[index]:g} N/m; higher ones do"
                )
            block[index] = 1.0 / left


def start(q: Mapping[str, float], x: int, state: Array, p: Array, work: Workspace) -> None:
    """At rest the sidewalls carry what the contact gives."""
    values = np.array(tuple(q.values()))
    in_plane, lateral, wind_up = stiffness(values)
    for wheel in range(4):
        own = x + PER_WHEEL * wheel
        axle, wrench = work.places.axles[wheel], work.tyres[wheel, T_WRENCH : T_WRENCH + 6]
        force = wrench[3:]
        across = (axle @ force) * axle
        state[own : own + 3] = (force - across) / in_plane + across / lateral
        belt = work.places.centres[wheel] + state[own : own + 3]
        state[own + 6] = float((wrench[:3] - np.cross(belt, force)) @ axle) / wind_up


EFFECT = Effect(
    name="wheel_rigid_ring",
    sentence="The tyre's belt is a ring of its own on the sidewalls: modes of 15 to 35 Hz between rim and road.",
    equation="m_b d2x/dt2 = F_contact - k x - c dx/dt, I_b d2theta/dt2 = -r_e F_x - k_t theta - c_t dtheta/dt, k = m_b (2 pi f)^2",
    parameters=(
        Parameter("belt_mass_kg", "kg", 165.0, 1.0, 2000.0, "m_b: of the wheel's mass", shape=True),
        Parameter(
            "belt_inertia_kg_m2", "kg m2", 76.0, 0.1, 2000.0, "I_b about the axle: of the wheel's", shape=True
        ),
        Parameter("in_plane_Hz", "Hz", 32.5, 8.0, 100.0, "f ahead and up, rim held", shape=True),
        Parameter("lateral_Hz", "Hz", 17.5, 8.0, 100.0, "f across, rim held", shape=True),
        Parameter("wind_up_Hz", "Hz", 27.5, 8.0, 100.0, "f about the axle, rim held", shape=True),
        Parameter("damping", "1", 0.05, 0.0, 0.5, "damping ratio of each", shape=True),
    ),
    acts_on="wheel speed, longitudinal and normal force, acceleration",
    signature="Ringing at fixed frequencies of 10 to 40 Hz after steps of torque and over short obstacles.",
    excited_by="brake steps, kerbs, locking wheels",
    confusable=(
        Confusable("driveline_torsion", "the shaft's mode is between the axles; the ring's is in each wheel"),
        Confusable("lug_excitation", "lugs follow the wheel's speed, the ring's frequencies stand still"),
    ),
    source="rigid ring of MF-Swift: Pacejka, Tire and Vehicle Dynamics, 3rd ed., chapter 9; values scaled from a passenger tyre",
    own_states=4 * PER_WHEEL,
)
