"""Measurement-driven replay of the plant, for the loader's diagnosis: measured torques and joint angles are inputs, all else is output.

Steering, lift arm and bucket follow the recorded demands of their cylinders, with a correction towards the measured angles. Without a recorded
demand they follow the measured angles alone. Cylinders lag as in the machine sheet; motors and brakes give the measured torque at once. A
feedback with a small gain corrects the speed towards the measured one: an error of force then shows as a steady difference of speed and does
not grow with time.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant.compiled import compiled, released
from plant.observer import PAYLOAD, TIME, observe
from plant.physics import state as s
from plant.physics.dynamics import advance
from plant.physics.parameters import (
    P_BRAKE_CAPACITY,
    P_BRAKE_LAG,
    P_DRIVE_LAG,
    P_DRIVE_RATE,
    P_LIFT,
    P_STEERING,
    P_TILT,
    P_WHEELS,
    SERVO_LAG,
    SERVO_RELIEF,
    W_PEAK_TORQUE,
    W_RADIUS,
    WHEEL_SIZE,
)
from plant.physics.resting import REST, moved_to_rest
from plant.physics.workspace import Workspace
from plant.plant import Plant
from plant.truth import Truth

Array = NDArray[np.float64]
Demanded = tuple[bool, bool, bool]
"""For each of JOINTS, whether the column of its rate holds the driver's demand and not the measured rate."""

# Columns of what was measured.
M_TORQUE: Final = 0  # four [N m]
M_BRAKING: Final = 4  # above zero while the brakes are applied
M_SPEED: Final = 5  # mean wheel speed [rad/s]
M_ARTICULATION: Final = 6  # angle [rad], and the rate [rad/s], measured or demanded
M_LIFT: Final = 8  # the same
M_TILT: Final = 10
M_TURNING: Final = 12  # four wheel speeds [rad/s]
MEASURED: Final = 16

JOINTS: Final = (
    (M_ARTICULATION, s.FRONT_FRAME, s.C_ARTICULATION_RATE, P_STEERING),
    (M_LIFT, s.LIFT_ARM, s.C_LIFT_RATE, P_LIFT),
    (M_TILT, s.BUCKET, s.C_TILT_RATE, P_TILT),
)
"""Driven joints: first column in the measurements, body, command, cylinder."""

MEASURED_LAG: Final = (
    2e-3  # lag of motors and brakes whose torque was measured [s], or the step if that is longer
)
ANGLE_GAIN: Final = 4.0  # rate at which the error of a joint angle decays [1/s]
DEMANDED_GAIN: Final = 1.0  # the same where the rate is a demand: cylinder and angle may differ for longer
HELD: Final = 0.05  # an applied brake holds a wheel that turns slower than this [rad/s]
GAIN: Final = 0.5  # rate at which the error of the speed decays [1/s]


@compiled
def command_of(
    command: Array,
    state: Array,
    m: Array,
    after: Array,
    interval: float,
    step: float,
    p: Array,
    demanded: Demanded,
) -> None:
    """Commands that make the plant do what was measured from one row to the next."""
    # The command is constant between two rows: take the measured torque in the middle of the interval, later by the lag of the motor
    # and by half a step, since the forces of a step use the torque at its start.
    middle = 0.5 + (p[P_DRIVE_LAG] + 0.5 * step) / interval
    for wheel in range(4):
        torque = m[M_TORQUE + wheel] + middle * (after[M_TORQUE + wheel] - m[M_TORQUE + wheel])
        capacity = 0.0
        standing = abs(m[M_TURNING + wheel]) < HELD
        # A measured torque against the motion, while the brake is applied, is friction: as a drive torque it would turn a stopped wheel
        # backwards. A standing wheel is held by the full capacity, because its holding torque is not measured.
        if m[M_BRAKING] > 0.0 and (standing or torque * m[M_SPEED] < 0.0):
            capacity = p[P_BRAKE_CAPACITY] if standing else abs(torque)
            torque = 0.0
        command[s.C_DRIVE + wheel], command[s.C_BRAKE + wheel] = torque, capacity
    for joint in range(3):
        at, body, rate, cylinder = JOINTS[joint]
        error = m[at] - state[s.JOINT + body]
        if demanded[joint]:
            # a frame holds the demand of the tick before it: the demand of this interval stands in the next row
            command[rate] = after[at + 1] + DEMANDED_GAIN * error
        else:
            ahead = 0.5 + p[cylinder + SERVO_LAG] / interval
            command[rate] = m[at + 1] + ahead * (after[at + 1] - m[at + 1]) + ANGLE_GAIN * error


@compiled
def draw(state: Array, m: Array, radius: float, share: float) -> None:
    """Correct the machine's speed towards the measured one by a share of the difference, body and rolling wheels alike."""
    w, x, y, z = (
        state[s.ATTITUDE],
        state[s.ATTITUDE + 1],
        state[s.ATTITUDE + 2],
        state[s.ATTITUDE + 3],
    )
    ahead = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    turning = 0.0
    for wheel in range(4):
        turning += 0.25 * state[s.JOINT_RATE + s.WHEEL + wheel]
    change = share * (m[M_SPEED] - turning)
    for i in range(3):
        state[s.VELOCITY + i] += change * radius * ahead[i]
    for wheel in range(4):
        if state[s.STICK + wheel] != 0.0:
            state[s.JOINT_RATE + s.WHEEL + wheel] += change


@compiled
def exact_servos(p: Array, step: float) -> Array:
    """Parameters with which explicit steps end where the cylinders do."""
    exact = p.copy()
    for joint in range(3):
        lag = JOINTS[joint][3] + SERVO_LAG
        exact[lag] = step / (1.0 - math.exp(-step / p[lag]))
    return exact


@released
def replay(
    starts: Array,
    rests: Array,
    measured: Array,
    edges: NDArray[np.intp],
    p: Array,
    demanded: Demanded,
    step: float,
    count: int,
    work: Workspace,
    active: Array | None,
    measures: Array,
    rows: Array,
    states: Array,
) -> None:
    """Replay one segment after the other from its start: measured[edges[i] : edges[i + 1]], `count` steps between rows.

    starts: (n, STATES). rests: (n, REST), equilibrium of each start on the plant it is from; (0, REST): starts are used as they are.
    Fills `rows` (n, Truth.size), and `states` (n, STATES) unless that is empty.
    """
    command = np.zeros(s.COMMANDS)
    radius = p[P_WHEELS + W_RADIUS]
    interval = count * step
    exact = exact_servos(p, step)
    for segment in range(edges.size - 1):
        begin, end = edges[segment], edges[segment + 1]
        state = starts[segment].copy()
        # the last command of the segment before it in the arrays would act on the accelerations of its first row
        command[:] = 0.0
        if rests.shape[0] > 0:
            moved_to_rest(state, rests[segment], p, work, active)
            draw(state, measured[begin], radius, 1.0)
        for k in range(begin, end):
            if states.shape[0] > 0:
                states[k] = state
            observe(rows[k], state, command, p, work, active, measures)
            after = measured[min(k + 1, end - 1)]
            command_of(command, state, measured[k], after, interval, step, p, demanded)
            rows[k, TIME] = (k - begin) * interval
            advance(state, command, exact, step, count, False, work, active)
            draw(state, after, radius, GAIN * interval)
            if not math.isfinite(state[s.POSITION]):
                break


def replay_parameters(p: Array, step: float, *, demanded: Demanded) -> Array:
    """The plant's parameters for a replay: joints, motors and brakes reproduce the measurements; cylinders with a recorded demand are unchanged."""
    replayed = p.copy()
    for (_, _, _, at), stays in zip(JOINTS, demanded, strict=True):
        if not stays:
            replayed[at : at + 2] = -math.pi, math.pi  # measured angles may pass the stops by their error
            replayed[at + 2 : at + 4] = 1e3
            replayed[at + SERVO_RELIEF] = math.inf
    replayed[P_DRIVE_LAG] = replayed[P_BRAKE_LAG] = max(MEASURED_LAG, step)
    replayed[P_DRIVE_RATE] = 1e12
    for wheel in range(4):
        replayed[P_WHEELS + wheel * WHEEL_SIZE + W_PEAK_TORQUE] = 1e9
    return replayed


def follow(
    plant: Plant,
    measured: Array,
    *,
    interval_s: float,
    step_s: float = 1e-3,
    demanded: Demanded = (False, False, False),
) -> tuple[Array, Array]:
    """Replay `measured` (n, MEASURED), one row every `interval_s`, with a plant at its start.

    Returns rows of Truth (n, Truth.size) and states of the plant (n, STATES). They are not numbers from where the motion diverged.
    The plant itself is not changed.
    """
    state, p, work, active, measures = plant.inside()
    rows, states = np.full((len(measured), Truth.size), np.nan), np.full((len(measured), s.STATES), np.nan)
    replay(
        state[None],
        np.zeros((0, REST)),
        measured,
        np.array((0, len(measured)), np.intp),
        replay_parameters(p, step_s, demanded=demanded),
        demanded,
        step_s,
        round(interval_s / step_s),
        work,
        active,
        measures,
        rows,
        states,
    )
    rows[:, PAYLOAD] = plant.payload_mass  # the compiled record leaves it out
    return rows, states
