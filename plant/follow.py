"""The plant led by a recording: measured torques and joint angles in, everything else out.

Steering, lift arm and bucket follow what their cylinders were asked for, drawn to their measured angles, or these angles alone where
no demand was recorded, through cylinders that lag as the sheet says; motors and brakes give the measured torque at once. A gain draws the speed towards the
measured one, so that an error of force shows as a steady difference and does not pile up.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant import state as s
from plant.compiled import compiled, released
from plant.dynamics import advance
from plant.parameters import (
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
from plant.plant import Plant
from plant.resting import REST, moved_to_rest
from plant.truth import PAYLOAD, TIME, Truth, observe
from plant.workspace import Workspace

Array = NDArray[np.float64]
Asked = tuple[bool, bool, bool]

# Columns of what was measured.
M_TORQUE: Final = 0  # four [N m]
M_BRAKING: Final = 4  # above zero while the brakes are applied
M_SPEED: Final = 5  # mean wheel speed [rad/s]
M_ARTICULATION: Final = 6  # angle [rad], and the rate [rad/s]: measured, or asked for
M_LIFT: Final = 8  # the same
M_TILT: Final = 10
M_TURNING: Final = 12  # four wheel speeds [rad/s]
MEASURED: Final = 16

JOINTS: Final = (
    (M_ARTICULATION, s.FRONT_FRAME, s.C_ARTICULATION_RATE, P_STEERING),
    (M_LIFT, s.LIFT_ARM, s.C_LIFT_RATE, P_LIFT),
    (M_TILT, s.BUCKET, s.C_TILT_RATE, P_TILT),
)
"""Driven joints: columns of what was measured, body, command, cylinder. In this order is told whose rates are those asked for."""

AT_ONCE: Final = 2e-3  # lag of motors and brakes whose torque was measured [s], or the step if that is longer
ANGLE_GAIN: Final = 4.0  # how fast an error of such an angle decays [1/s]
ASKED_GAIN: Final = 1.0  # the same where the rate is the one that was asked for
HELD: Final = 0.05  # wheel speed below which an applied brake holds the wheel [rad/s]
GAIN: Final = 0.5  # with which the speed is drawn to the measured one [1/s]


@compiled
def _command(
    command: Array, state: Array, m: Array, after: Array, interval: float, step: float, p: Array, asked: Asked
) -> None:
    """Commands that make the plant do what was measured from one row to the next."""
    # a lagging motor or servo is asked for what comes later; forces follow the torque with the step before
    middle = 0.5 + (p[P_DRIVE_LAG] + 0.5 * step) / interval
    for wheel in range(4):
        torque = m[M_TORQUE + wheel] + middle * (after[M_TORQUE + wheel] - m[M_TORQUE + wheel])
        capacity = 0.0
        standing = abs(m[M_TURNING + wheel]) < HELD
        if m[M_BRAKING] > 0.0 and (standing or torque * m[M_SPEED] < 0.0):
            capacity = p[P_BRAKE_CAPACITY] if standing else abs(torque)
            torque = 0.0
        command[s.C_DRIVE + wheel], command[s.C_BRAKE + wheel] = torque, capacity
    for joint in range(3):
        at, body, rate, cylinder = JOINTS[joint]
        error = m[at] - state[s.JOINT + body]
        if asked[joint]:
            # a frame tells what the tick before it was asked for
            command[rate] = after[at + 1] + ASKED_GAIN * error
        else:
            lead_in = 0.5 + p[cylinder + SERVO_LAG] / interval
            command[rate] = m[at + 1] + lead_in * (after[at + 1] - m[at + 1]) + ANGLE_GAIN * error


@compiled
def draw(state: Array, work: Workspace, m: Array, radius: float, share: float) -> None:
    """Draw the machine's speed towards the measured one by a share of the difference."""
    turning = 0.0
    for wheel in range(4):
        turning += 0.25 * state[s.JOINT_RATE + s.WHEEL + wheel]
    change = share * (m[M_SPEED] - turning)
    for i in range(3):
        state[s.VELOCITY + i] += change * radius * work.places.world[i, 0]
    for wheel in range(4):
        if state[s.STICK + wheel] != 0.0:
            state[s.JOINT_RATE + s.WHEEL + wheel] += change


@released
def lead(
    starts: Array,
    rests: Array,
    measured: Array,
    edges: NDArray[np.intp],
    p: Array,
    asked: Asked,
    step: float,
    count: int,
    work: Workspace,
    active: Array | None,
    measures: Array,
    rows: Array,
    states: Array,
) -> None:
    """Lead one start after the other through its stretch measured[edges[i] : edges[i + 1]], `count` steps between rows.

    asked: whether the measured rate of each of JOINTS is the one asked for. rests: (n, REST) of each start on the plant it is from, or (0, REST) to take starts as they are.
    Fills `rows` (n, Truth.size), and `states` (n, STATES) unless that is empty.
    """
    command = np.zeros(s.COMMANDS)
    radius = p[P_WHEELS + W_RADIUS]
    interval = count * step
    exact = p.copy()
    for joint in range(3):
        lag = JOINTS[joint][3] + SERVO_LAG
        exact[lag] = step / (
            1.0 - math.exp(-step / p[lag])
        )  # explicit steps then end where the cylinder does
    for stretch in range(edges.size - 1):
        begin, end = edges[stretch], edges[stretch + 1]
        state = starts[stretch].copy()
        if rests.shape[0] > 0:
            moved_to_rest(state, rests[stretch], p, work, active)
            draw(state, work, measured[begin], radius, 1.0)
        for k in range(begin, end):
            if states.shape[0] > 0:
                states[k] = state
            observe(rows[k], state, command, p, work, active, measures)
            after = measured[min(k + 1, end - 1)]
            _command(command, state, measured[k], after, interval, step, p, asked)
            rows[k, TIME] = (k - begin) * interval
            advance(state, command, exact, step, count, False, work, active)
            draw(state, work, after, radius, GAIN * interval)
            if not math.isfinite(state[s.POSITION]):
                break


def led_parameters(p: Array, step: float, *, asked: Asked) -> Array:
    """The plant's parameters with joints, motors and brakes that do what was measured; asked: cylinders that stay as they are."""
    led = p.copy()
    for (_, _, _, at), stays in zip(JOINTS, asked, strict=True):
        if not stays:
            led[at : at + 2] = -math.pi, math.pi  # measured angles may pass the stops by their error
            led[at + 2 : at + 4] = 1e3
            led[at + SERVO_RELIEF] = math.inf
    led[P_DRIVE_LAG] = led[P_BRAKE_LAG] = max(AT_ONCE, step)
    led[P_DRIVE_RATE] = 1e12
    for wheel in range(4):
        led[P_WHEELS + wheel * WHEEL_SIZE + W_PEAK_TORQUE] = 1e9
    return led


def follow(
    plant: Plant,
    measured: Array,
    *,
    interval_s: float,
    step_s: float = 1e-3,
    asked: Asked = (False, False, False),
) -> tuple[Array, Array]:
    """Lead a plant at its start through `measured` (n, MEASURED), one row every `interval_s`.

    asked: whether the rate of each of JOINTS is the one asked for [rad/s]. Returns rows of Truth and states of the plant; from where the
    motion diverged on they are not numbers. The plant itself stays as it is.
    """
    state, p, work, active, measures = plant.inside()
    rows, states = np.full((len(measured), Truth.size), np.nan), np.full((len(measured), s.STATES), np.nan)
    lead(
        state[None],
        np.zeros((0, REST)),
        measured,
        np.array((0, len(measured)), np.intp),
        led_parameters(p, step_s, asked=asked),
        asked,
        step_s,
        round(interval_s / step_s),
        work,
        active,
        measures,
        rows,
        states,
    )
    finish(rows, plant.payload_mass)
    return rows, states


def finish(rows: Array, payload_mass: float) -> None:
    """What the compiled record leaves out: payload, and slip angles from their tangents."""
    rows[:, PAYLOAD] = payload_mass
    slip_angle = Truth.slip_angle.column(rows)
    np.arctan(slip_angle, out=slip_angle)
