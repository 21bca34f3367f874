"""Equations of motion of the loader and their two integrators, compiled.

Free joints: the rear frame, the oscillating axle, the wheels. Driven joints: articulation, lift arm and bucket, whose cylinders follow a
demanded rate with a lag and cushioned end stops; their efforts are results. A wheel held by its brake is a driven joint as well, until the
holding torque exceeds the capacity of the brake. Therefore a locked wheel stays locked and the machine stands on a slope without creeping,
which a friction law smoothed about zero speed would not achieve.
"""

import math

import numpy as np
from numpy.typing import NDArray

from plant.compiled import inlined, uncounted
from plant.effects import dispatch as effects
from plant.effects.ports import climb
from plant.physics.kinematics import place_loader
from plant.physics.multibody import Tree, solve_tree
from plant.physics.parameters import (
    P_BRAKE_CAPACITY,
    P_BRAKE_LAG,
    P_DRIVE_LAG,
    P_DRIVE_RATE,
    P_FRICTION,
    P_GRAVITY,
    P_LIFT,
    P_NORMAL,
    P_SHAFT,
    P_SHAFT_DAMPING,
    P_SHAFT_STIFFNESS,
    P_STEERING,
    P_STOP_ANGLE,
    P_STOP_DAMPING,
    P_STOP_STIFFNESS,
    P_TILT,
    P_WHEELS,
    SERVO_SIZE,
    W_PEAK_TORQUE,
    WHEEL_SIZE,
)
from plant.physics.relief import give_way, overloaded, surely_within
from plant.physics.state import (
    ANGULAR,
    ATTITUDE,
    BODIES,
    BRAKE,
    BUCKET,
    C_ARTICULATION_RATE,
    C_BRAKE,
    C_DRIVE,
    C_LIFT_RATE,
    C_TILT_RATE,
    DRIVE,
    EXTRA,
    FRONT_FRAME,
    G_FRICTION,
    G_HEIGHT,
    G_RISE,
    G_SLOPE,
    JOINT,
    JOINT_RATE,
    KAPPA,
    LIFT_ARM,
    POSITION,
    REAR_AXLE,
    REAR_FRAME,
    SHAFT,
    STATES,
    STICK,
    T_KAPPA_RATE,
    T_TAN_ALPHA_RATE,
    T_WRENCH,
    TAN_ALPHA,
    VELOCITY,
    WHEEL,
)
from plant.physics.tyre import wheel_contact
from plant.physics.workspace import Workspace

Array = NDArray[np.float64]

STOPPING = 0.01  # time constant in which a stroke end stops its joint [s]
RELEASED = 1.0  # friction torque below which a brake does not lock a wheel that changes its direction [N m]


@uncounted
def servo(angle: float, rate: float, demand: float, block: Array) -> float:
    """Acceleration of a cylinder-driven joint towards the demanded rate [rad/s²].

    block: lower and upper limit, falling and rising rate limit, lag, cushion lag. Near a limit the
    rate is limited so that the cushion stops the joint in time. A cylinder that a load drives beyond its stroke is
    stopped there and returns.
    """
    lower, upper, falling, rising, lag, cushion = block[0], block[1], block[2], block[3], block[4], block[5]
    demand = min(max(demand, -falling), rising)
    # distance to the stop over the cushion's time constant: the joint approaches the stop exponentially and never hits it
    demand = min(max(demand, (lower - angle) / cushion), (upper - angle) / cushion)
    if angle > upper and rate > 0.0:
        return min((demand - rate) / lag, -rate / STOPPING)
    if angle < lower and rate < 0.0:
        return max((demand - rate) / lag, -rate / STOPPING)
    return (demand - rate) / lag


@uncounted
def stop_moment(angle: float, rate: float, p: Array) -> float:
    """Moment of the oscillation stops on the rear axle [N m]; they push, never pull."""
    limit = p[P_STOP_ANGLE]
    if angle > limit:
        return min(-p[P_STOP_STIFFNESS] * (angle - limit) - p[P_STOP_DAMPING] * rate, 0.0)
    if angle < -limit:
        return max(-p[P_STOP_STIFFNESS] * (angle + limit) - p[P_STOP_DAMPING] * rate, 0.0)
    return 0.0


@uncounted
def axle_difference(state: Array) -> float:
    """How much faster the front axle's differential turns than the rear one's [rad/s]."""
    w = JOINT_RATE + WHEEL
    return 0.5 * (state[w] + state[w + 1] - state[w + 2] - state[w + 3])


@uncounted
def drive_torque(state: Array, p: Array, wheel: int) -> float:
    """Torque of the driveline on a wheel [N m]: from its motor, or from its differential."""
    if p[P_SHAFT] == 0.0:
        return state[DRIVE + wheel]
    wound = p[P_SHAFT_STIFFNESS] * state[SHAFT] + p[P_SHAFT_DAMPING] * axle_difference(state)
    return state[DRIVE + wheel] + (-0.5 if wheel < 2 else 0.5) * wound


@uncounted
def drive_demand(command: Array, p: Array, wheel: int) -> float:
    """Demanded torque [N m], limited to the peak torque; with a shaft all wheels get equal shares."""
    if p[P_SHAFT] != 0.0:
        total = 0.0
        for other in range(4):
            peak = p[P_WHEELS + other * WHEEL_SIZE + W_PEAK_TORQUE]
            total += min(max(command[C_DRIVE + other], -peak), peak)
        return total / 4.0
    peak = p[P_WHEELS + wheel * WHEEL_SIZE + W_PEAK_TORQUE]
    return min(max(command[C_DRIVE + wheel], -peak), peak)


@inlined
def set_joints(state: Array, command: Array, p: Array, tree: Tree) -> None:
    """Accelerations of the driven joints and efforts of the free ones."""
    for body in range(BODIES):
        tree.driven[body] = 0.0
        tree.effort[body] = 0.0
    tree.driven[FRONT_FRAME] = tree.driven[LIFT_ARM] = tree.driven[BUCKET] = 1.0
    tree.joint_acceleration[FRONT_FRAME] = servo(
        state[JOINT + FRONT_FRAME],
        state[JOINT_RATE + FRONT_FRAME],
        command[C_ARTICULATION_RATE],
        p[P_STEERING : P_STEERING + SERVO_SIZE],
    )
    lifting = servo(
        state[JOINT + LIFT_ARM],
        state[JOINT_RATE + LIFT_ARM],
        command[C_LIFT_RATE],
        p[P_LIFT : P_LIFT + SERVO_SIZE],
    )
    tilting = servo(
        state[JOINT + BUCKET],
        state[JOINT_RATE + BUCKET],
        command[C_TILT_RATE],
        p[P_TILT : P_TILT + SERVO_SIZE],
    )
    tree.joint_acceleration[LIFT_ARM] = lifting
    # the state holds the bucket's angle against the front frame (the Z-bar keeps it there), the joint turns against the arm
    tree.joint_acceleration[BUCKET] = tilting - lifting
    tree.effort[REAR_AXLE] = stop_moment(state[JOINT + REAR_AXLE], state[JOINT_RATE + REAR_AXLE], p)
    for wheel in range(4):
        body = WHEEL + wheel
        if (
            state[STICK + wheel] == 0.0
        ):  # held: a prescribed acceleration of zero, and the solver returns the holding torque
            tree.driven[body] = 1.0
            tree.joint_acceleration[body] = 0.0
        else:
            friction = state[STICK + wheel] * state[BRAKE + wheel]
            tree.effort[body] = drive_torque(state, p, wheel) - friction


@inlined
def prepare_wheel(block: Array, wheel: int, work: Workspace) -> None:
    """Give effects a copy of the tyre block, and even ground, which they may change."""
    for i in range(WHEEL_SIZE):
        work.local[wheel, i] = block[i]
    work.ground[wheel, G_HEIGHT] = work.ground[wheel, G_RISE] = work.ground[wheel, G_SLOPE] = 0.0
    work.ground[wheel, G_FRICTION] = 1.0


@inlined
def apply_tyres(state: Array, p: Array, ahead: float, work: Workspace, active: Array | None) -> None:
    """Tyre forces on the wheels, and the rates of the transient slips."""
    normal, world = work.normal, work.places.world
    height = 0.0
    for i in range(3):
        height += p[P_NORMAL + i] * state[POSITION + i]
        normal[i] = 0.0
        for j in range(3):
            normal[i] += world[j, i] * p[P_NORMAL + j]
    if active is not None:
        for wheel in range(4):
            prepare_wheel(p[P_WHEELS + wheel * WHEEL_SIZE : P_WHEELS + (wheel + 1) * WHEEL_SIZE], wheel, work)
        if active[effects.BEFORE_TYRE] != 0.0:
            effects.before_tyre(active, state, p, work)
    for wheel in range(4):
        centre, out, bias = work.places.centres[wheel], work.tyres[wheel], work.tree.bias[WHEEL + wheel]
        above = height + normal[0] * centre[0] + normal[1] * centre[1] + normal[2] * centre[2]
        block = p[P_WHEELS + wheel * WHEEL_SIZE : P_WHEELS + (wheel + 1) * WHEEL_SIZE]
        friction, rise = p[P_FRICTION], 0.0
        if active is not None:
            block = work.local[wheel]
            friction *= work.ground[wheel, G_FRICTION]
            above -= work.ground[wheel, G_HEIGHT]
            rise = work.ground[wheel, G_RISE]
        kappa, tan_alpha = state[KAPPA + wheel], state[TAN_ALPHA + wheel]
        motion = work.tree.motion[WHEEL + wheel]
        wheel_contact(
            block,
            friction,
            rise,
            centre,
            above,
            work.places.axles[wheel],
            normal,
            motion,
            kappa,
            tan_alpha,
            ahead,
            out,
        )
        for i in range(6):
            bias[i] -= out[T_WRENCH + i]
        work.rate[KAPPA + wheel] = out[T_KAPPA_RATE]
        work.rate[TAN_ALPHA + wheel] = out[T_TAN_ALPHA_RATE]
    if active is not None:
        if active[effects.BEFORE_TYRE] != 0.0:  # nothing else raises the ground
            for wheel in range(4):
                climb(work, wheel)
        if active[effects.AFTER_TYRE] != 0.0:
            effects.after_tyre(active, state, p, work)


@uncounted
def centre_of_gravity(tree: Tree, whole: Array) -> None:
    """Mass [kg] and centre of gravity [m] of all bodies together, before the tree is solved."""
    mass, x, y, z = 0.0, 0.0, 0.0, 0.0
    for body in range(BODIES):
        inertia = tree.inertia[body]
        mass += inertia[5, 5]
        x += inertia[2, 4]
        y += inertia[0, 5]
        z += inertia[1, 3]
    whole[0], whole[1], whole[2], whole[3] = mass, x / mass, y / mass, z / mass


@uncounted
def set_up(
    state: Array, command: Array, p: Array, ahead: float, work: Workspace, active: Array | None
) -> None:
    """Fill the tree for the solver: inertias, forces, demands of the joints."""
    tree = work.tree
    if active is not None:
        for i in range(EXTRA, STATES):
            work.rate[i] = 0.0
        work.ahead[0] = ahead
    place_loader(state, p, tree, work.places)
    centre_of_gravity(tree, work.whole)
    set_joints(state, command, p, tree)
    if active is not None and active[effects.JOINTS] != 0.0:
        effects.joints(active, state, p, work)
    apply_tyres(state, p, ahead, work, active)
    if active is not None and active[effects.BODIES] != 0.0:
        effects.bodies(active, state, p, work)


@uncounted
def open_valves(
    state: Array, command: Array, p: Array, ahead: float, work: Workspace, active: Array | None
) -> None:
    """Solve the tree again with open relief valves, if a cylinder is overloaded; arguments as of `derivative`."""
    if overloaded(state, p, work.tree):
        # again, because the solver has overwritten inertias and biases
        set_up(state, command, p, ahead, work, active)
        give_way(state, p, work.tree)


@uncounted
def derivative(
    state: Array, command: Array, p: Array, ahead: float, work: Workspace, active: Array | None
) -> None:
    """Rate of the state, into work.rate; work also holds forces and accelerations.

    ahead: step [s] for which the transient slips are taken at its end, 0 for the true derivative.
    active: the effects that are switched on (plant.effects.dispatch), or None; without any, the compiler
    leaves out every call of them.
    """
    tree, world, rate = work.tree, work.places.world, work.rate
    set_up(state, command, p, ahead, work, active)
    solve_tree(tree)
    if not surely_within(state, p, tree):
        open_valves(state, command, p, ahead, work, active)

    # The solver works relative to free fall and in the rear frame's moving axes, so add the transport term (omega x v), turn the result
    # to world axes, and add gravity.
    a, v = tree.acceleration[REAR_FRAME], tree.motion[REAR_FRAME]
    x = a[3] + v[1] * v[5] - v[2] * v[4]
    y = a[4] + v[2] * v[3] - v[0] * v[5]
    z = a[5] + v[0] * v[4] - v[1] * v[3]
    for i in range(3):
        rate[POSITION + i] = state[VELOCITY + i]
        rate[ANGULAR + i] = a[i]
        rate[VELOCITY + i] = world[i, 0] * x + world[i, 1] * y + world[i, 2] * z
    rate[VELOCITY + 2] -= p[P_GRAVITY]
    quaternion_rate(state, rate)
    for body in range(1, BODIES):
        rate[JOINT + body] = state[JOINT_RATE + body]
        rate[JOINT_RATE + body] = tree.joint_acceleration[body]
    rate[JOINT_RATE + BUCKET] += tree.joint_acceleration[LIFT_ARM]
    for wheel in range(4):
        change = (drive_demand(command, p, wheel) - state[DRIVE + wheel]) / p[P_DRIVE_LAG]
        rate[DRIVE + wheel] = min(max(change, -p[P_DRIVE_RATE]), p[P_DRIVE_RATE])
        available = min(max(command[C_BRAKE + wheel], 0.0), p[P_BRAKE_CAPACITY])
        rate[BRAKE + wheel] = (available - state[BRAKE + wheel]) / p[P_BRAKE_LAG]
        rate[STICK + wheel] = 0.0
    rate[SHAFT] = axle_difference(state) if p[P_SHAFT] != 0.0 else 0.0
    if active is not None and active[effects.STATES] != 0.0:
        effects.states(active, state, p, work)


@uncounted
def quaternion_rate(state: Array, rate: Array) -> None:
    """Rate of the attitude from the angular velocity in body axes."""
    w, x, y, z = state[ATTITUDE], state[ATTITUDE + 1], state[ATTITUDE + 2], state[ATTITUDE + 3]
    p, q, r = state[ANGULAR], state[ANGULAR + 1], state[ANGULAR + 2]
    rate[ATTITUDE] = 0.5 * (-x * p - y * q - z * r)
    rate[ATTITUDE + 1] = 0.5 * (w * p + y * r - z * q)
    rate[ATTITUDE + 2] = 0.5 * (w * q + z * p - x * r)
    rate[ATTITUDE + 3] = 0.5 * (w * r + x * q - y * p)


@uncounted
def normalise(state: Array) -> None:
    """Unit attitude."""
    square = 0.0
    for i in range(4):
        square += state[ATTITUDE + i] ** 2
    scale = 1.0 / math.sqrt(square)
    for i in range(4):
        state[ATTITUDE + i] *= scale


@uncounted
def turn(state: Array, step: float) -> None:
    """Turn the attitude by the angular velocity over one step, exactly for a constant one."""
    p, q, r = state[ANGULAR], state[ANGULAR + 1], state[ANGULAR + 2]
    half = 0.5 * step * math.sqrt(p * p + q * q + r * r)
    # sin(half)/half by its series where the quotient loses digits
    sinc = math.sin(half) / half if half > 1e-4 else 1.0 - half * half / 6.0
    c, k = math.cos(half), 0.5 * step * sinc
    w, x, y, z = state[ATTITUDE], state[ATTITUDE + 1], state[ATTITUDE + 2], state[ATTITUDE + 3]
    state[ATTITUDE] = c * w + k * (-x * p - y * q - z * r)
    state[ATTITUDE + 1] = c * x + k * (w * p + y * r - z * q)
    state[ATTITUDE + 2] = c * y + k * (w * q + z * p - x * r)
    state[ATTITUDE + 3] = c * z + k * (w * r + x * q - y * p)


@inlined
def hold_or_slip(state: Array, p: Array, work: Workspace) -> None:
    """Release wheels whose brake was overcome; hold wheels whose slipping brake came to rest.

    Uses the efforts of the last evaluation and the present wheel speeds.
    """
    for wheel in range(4):
        stick = state[STICK + wheel]
        if stick == 0.0:
            friction = work.tree.effort[WHEEL + wheel] - drive_torque(state, p, wheel)
            if abs(friction) > state[BRAKE + wheel]:
                state[STICK + wheel] = -math.copysign(1.0, friction)
        # the wheel's speed has passed zero within the step: friction stops it there, it cannot drive it backwards
        elif state[JOINT_RATE + WHEEL + wheel] * stick < 0.0:
            if state[BRAKE + wheel] > RELEASED:
                state[JOINT_RATE + WHEEL + wheel] = 0.0
                state[STICK + wheel] = 0.0
            else:
                state[STICK + wheel] = -stick


@inlined
def step_semi_implicit(
    state: Array, command: Array, p: Array, step: float, work: Workspace, active: Array | None
) -> None:
    """One step: velocities from the forces, then positions from the new velocities."""
    # Semi-implicit Euler is symplectic: the stiff, weakly damped tyre springs neither gain energy nor need several evaluations per step.
    # `ahead` = step makes the transient slips implicit, since their time constant (relaxation length over speed) may be below a step.
    derivative(state, command, p, step, work, active)
    rate = work.rate
    for i in range(VELOCITY, STATES if active is not None else EXTRA):
        state[i] += step * rate[i]
    for i in range(3):
        state[POSITION + i] += step * state[VELOCITY + i]
    turn(state, step)
    for body in range(1, BODIES):
        state[JOINT + body] += step * state[JOINT_RATE + body]


@inlined
def step_rk4(
    state: Array,
    command: Array,
    p: Array,
    step: float,
    work: Workspace,
    active: Array | None,
) -> None:
    """One step of the classical Runge-Kutta method of fourth order."""
    trial, total = work.scratch[0], work.scratch[1]
    count = STATES if active is not None else EXTRA
    for i in range(count):
        trial[i] = state[i]
        total[i] = 0.0
    for stage in range(4):
        derivative(trial, command, p, 0.0, work, active)
        weight = step / 6.0 if stage in (0, 3) else step / 3.0
        reach = step if stage == 2 else 0.5 * step
        for i in range(count):
            total[i] += weight * work.rate[i]
            trial[i] = state[i] + reach * work.rate[i]
    for i in range(count):
        state[i] += total[i]


@uncounted
def advance(
    state: Array,
    command: Array,
    p: Array,
    step: float,
    count: int,
    fourth_order: bool,
    work: Workspace,
    active: Array | None,
) -> None:
    """`count` steps with constant commands."""
    for _ in range(count):
        if fourth_order:
            step_rk4(state, command, p, step, work, active)
        else:
            step_semi_implicit(state, command, p, step, work, active)
        normalise(state)  # rounding, and RK4's linear steps, leave the unit sphere
        hold_or_slip(state, p, work)
