"""What effects use of the plant: forces on bodies, and where the contact points are."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array
from plant.physics.parameters import P_NORMAL, P_STEERING, SERVO_LAG, W_RADIUS
from plant.physics.state import (
    FRONT_FRAME,
    G_HEIGHT,
    G_RISE,
    G_SLOPE,
    JOINT,
    JOINT_RATE,
    POSITION,
    T_ALIGNING,
    T_DEFLECTION,
    T_LATERAL,
    T_LONGITUDINAL,
    T_NORMAL,
    T_WRENCH,
    WHEEL,
)
from plant.physics.workspace import Workspace

TURNING = 0.05  # spin below which a resistance to rolling fades, so that it cannot turn a standing wheel back [rad/s]
LEAST = 1e-9  # keeps the heading of a wheel that lies on its side finite


@uncounted
def push(work: Workspace, body: int, x: float, y: float, z: float, fx: float, fy: float, fz: float) -> None:
    """A force (fx, fy, fz) [N] on a body at the point (x, y, z) [m]; rear-frame axes, before the tree is solved."""
    bias = work.tree.bias[body]
    bias[0] -= y * fz - z * fy
    bias[1] -= z * fx - x * fz
    bias[2] -= x * fy - y * fx
    bias[3] -= fx
    bias[4] -= fy
    bias[5] -= fz


@uncounted
def twist(work: Workspace, body: int, mx: float, my: float, mz: float) -> None:
    """A moment [N m] on a body; rear-frame axes, before the tree is solved."""
    bias = work.tree.bias[body]
    bias[0] -= mx
    bias[1] -= my
    bias[2] -= mz


@uncounted
def heading(work: Workspace, wheel: int) -> tuple[float, float, float, float, float, float]:
    """Unit vectors of a wheel in the road's plane, ahead and left, rear-frame axes."""
    n, a = work.normal, work.places.axles[wheel]
    hx, hy, hz = a[1] * n[2] - a[2] * n[1], a[2] * n[0] - a[0] * n[2], a[0] * n[1] - a[1] * n[0]
    size = max(math.sqrt(hx * hx + hy * hy + hz * hz), LEAST)
    hx, hy, hz = hx / size, hy / size, hz / size
    return hx, hy, hz, n[1] * hz - n[2] * hy, n[2] * hx - n[0] * hz, n[0] * hy - n[1] * hx


@uncounted
def spin(work: Workspace, wheel: int) -> float:
    """Angular velocity of a wheel about its axle against the ground [rad/s], positive rolling ahead."""
    motion, axle = work.tree.motion[WHEEL + wheel], work.places.axles[wheel]
    return motion[0] * axle[0] + motion[1] * axle[1] + motion[2] * axle[2]


@uncounted
def contact_point(work: Workspace, wheel: int) -> tuple[float, float, float]:
    """Where a tyre touches the road [m], rear-frame axes; after the tyre model has run."""
    hx, hy, hz, _, _, _ = heading(work, wheel)
    a, centre = work.places.axles[wheel], work.places.centres[wheel]
    loaded = work.local[wheel, W_RADIUS] - work.tyres[wheel, T_DEFLECTION]
    ux, uy, uz = hy * a[2] - hz * a[1], hz * a[0] - hx * a[2], hx * a[1] - hy * a[0]
    return centre[0] - loaded * ux, centre[1] - loaded * uy, centre[2] - loaded * uz


@uncounted
def push_tyre(
    work: Workspace, wheel: int, x: float, y: float, z: float, fx: float, fy: float, fz: float
) -> None:
    """A force (fx, fy, fz) [N] on a wheel at the point (x, y, z) [m] that counts in its tyre's wrench."""
    push(work, WHEEL + wheel, x, y, z, fx, fy, fz)
    out = work.tyres[wheel]
    out[T_WRENCH] += y * fz - z * fy
    out[T_WRENCH + 1] += z * fx - x * fz
    out[T_WRENCH + 2] += x * fy - y * fx
    out[T_WRENCH + 3] += fx
    out[T_WRENCH + 4] += fy
    out[T_WRENCH + 5] += fz


@uncounted
def push_wheel(work: Workspace, wheel: int, along: float, across: float, moment: float) -> None:
    """Forces of a tyre along and across its wheel [N] and about the road's normal [N m], beside those of its model.

    They act at the contact point and count in what the tyre reports.
    """
    hx, hy, hz, sx, sy, sz = heading(work, wheel)
    x, y, z = contact_point(work, wheel)
    n, out = work.normal, work.tyres[wheel]
    fx, fy, fz = along * hx + across * sx, along * hy + across * sy, along * hz + across * sz
    push_tyre(work, wheel, x, y, z, fx, fy, fz)
    twist(work, WHEEL + wheel, moment * n[0], moment * n[1], moment * n[2])
    out[T_LONGITUDINAL] += along
    out[T_LATERAL] += across
    out[T_ALIGNING] += moment
    for i in range(3):
        out[T_WRENCH + i] += moment * n[i]


@uncounted
def twist_wheel(work: Workspace, wheel: int, moment: float) -> None:
    """A moment of the tyre about the wheel's axle [N m], positive driving ahead."""
    a, out = work.places.axles[wheel], work.tyres[wheel]
    twist(work, WHEEL + wheel, moment * a[0], moment * a[1], moment * a[2])
    for i in range(3):
        out[T_WRENCH + i] += moment * a[i]


@uncounted
def resist_rolling(work: Workspace, wheel: int, turning: float, coefficient: float) -> None:
    """A moment against the spin `turning` [rad/s] of a wheel, as a share of its load times its unloaded radius."""
    moment = -coefficient * work.tyres[wheel, T_NORMAL] * work.local[wheel, W_RADIUS]
    twist_wheel(work, wheel, moment * math.tanh(turning / TURNING))


@uncounted
def carrier_motion(work: Workspace, wheel: int) -> tuple[float, float, float]:
    """Velocity of a wheel's centre ahead and to the left [m/s], and yaw rate about the road's normal [rad/s]."""
    hx, hy, hz, sx, sy, sz = heading(work, wheel)
    m, c, n = work.tree.motion[WHEEL + wheel], work.places.centres[wheel], work.normal
    vx, vy, vz = (
        m[3] + m[1] * c[2] - m[2] * c[1],
        m[4] + m[2] * c[0] - m[0] * c[2],
        m[5] + m[0] * c[1] - m[1] * c[0],
    )
    ahead, left = vx * hx + vy * hy + vz * hz, vx * sx + vy * sy + vz * sz
    return ahead, left, m[0] * n[0] + m[1] * n[1] + m[2] * n[2]


@uncounted
def push_centre(work: Workspace, wheel: int, along: float) -> None:
    """A force on a wheel's centre along its heading [N]: resistance without a moment about the axle."""
    hx, hy, hz, _, _, _ = heading(work, wheel)
    c = work.places.centres[wheel]
    push_tyre(work, wheel, c[0], c[1], c[2], along * hx, along * hy, along * hz)
    work.tyres[wheel, T_LONGITUDINAL] += along


@uncounted
def lean(work: Workspace, wheel: int) -> float:
    """Sine of a wheel's lean against the road's normal, positive when its top leans to the left."""
    a, n = work.places.axles[wheel], work.normal
    return -(a[0] * n[0] + a[1] * n[1] + a[2] * n[2])


@uncounted
def pressed(state: Array, p: Array, work: Workspace, wheel: int) -> float:
    """How far a tyre is pressed in [m], before the tyre model has run; negative: clearance."""
    c, n = work.places.centres[wheel], work.normal
    height = c[0] * n[0] + c[1] * n[1] + c[2] * n[2] - work.ground[wheel, G_HEIGHT]
    for i in range(3):
        height += p[P_NORMAL + i] * state[POSITION + i]
    return work.local[wheel, W_RADIUS] - height / math.sqrt(max(1.0 - lean(work, wheel) ** 2, LEAST))


@uncounted
def steering_cylinders(state: Array, p: Array, work: Workspace, x: int) -> tuple[float, float]:
    """Let the steering cylinders move as demanded and the joint go free of them: how far [rad] and how fast they are ahead of it.

    x: the effect's first own state of two, angle and rate of the cylinders; in the joints hook.
    """
    tree, lag = work.tree, p[P_STEERING + SERVO_LAG]
    angle, rate = state[JOINT + FRONT_FRAME], state[JOINT_RATE + FRONT_FRAME]
    demand = rate + lag * tree.joint_acceleration[FRONT_FRAME]
    tree.driven[FRONT_FRAME] = 0.0
    work.rate[x] = state[x + 1]
    work.rate[x + 1] = (demand - state[x + 1]) / lag
    return state[x] - angle, state[x + 1] - rate


@uncounted
def in_world(state: Array, work: Workspace, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Where a point of the rear frame's axes is in the world [m]."""
    r = work.places.world
    return (
        state[POSITION] + r[0, 0] * x + r[0, 1] * y + r[0, 2] * z,
        state[POSITION + 1] + r[1, 0] * x + r[1, 1] * y + r[1, 2] * z,
        state[POSITION + 2] + r[2, 0] * x + r[2, 1] * y + r[2, 2] * z,
    )


@uncounted
def along_ground(state: Array, work: Workspace, wheel: int) -> float:
    """Where a wheel's centre is along the world's x axis [m]."""
    c = work.places.centres[wheel]
    return in_world(state, work, c[0], c[1], c[2])[0]


@uncounted
def raise_ground(state: Array, work: Workspace, wheel: int, height: float, slope: float) -> None:
    """Raise the ground under a wheel by a profile's height [m] with its slope along the world's x axis.

    The slope makes the ground rise as the wheel goes on, and turns the load (climb).
    """
    motion, c, r = work.tree.motion[WHEEL + wheel], work.places.centres[wheel], work.places.world
    vx = motion[3] + motion[1] * c[2] - motion[2] * c[1]
    vy = motion[4] + motion[2] * c[0] - motion[0] * c[2]
    vz = motion[5] + motion[0] * c[1] - motion[1] * c[0]
    work.ground[wheel, G_HEIGHT] += height
    work.ground[wheel, G_RISE] += slope * (r[0, 0] * vx + r[0, 1] * vy + r[0, 2] * vz)
    work.ground[wheel, G_SLOPE] += slope


@uncounted
def climb(work: Workspace, wheel: int) -> None:
    """The ground's slope turns a wheel's load back: what lifts the machine costs it speed. After the tyre model.

    The spring's energy depends on the road's height under the wheel's centre, so its force there along the world's
    x axis is -load slope; with the rise of raise_ground the damper takes energy and never gives any. No moment about the axle.
    """
    back = -work.tyres[wheel, T_NORMAL] * work.ground[wheel, G_SLOPE]
    if back == 0.0:
        return
    c, r = work.places.centres[wheel], work.places.world
    fx, fy, fz = back * r[0, 0], back * r[0, 1], back * r[0, 2]
    push_tyre(work, wheel, c[0], c[1], c[2], fx, fy, fz)
    hx, hy, hz, sx, sy, sz = heading(work, wheel)
    work.tyres[wheel, T_LONGITUDINAL] += fx * hx + fy * hy + fz * hz
    work.tyres[wheel, T_LATERAL] += fx * sx + fy * sy + fz * sz
