"""The plant led by a recording: measured torques and joint angles in, everything else out.

The working joints follow their measured angles; the motors and brakes give the measured torque at once. A gain
draws the speed towards the measured one, so that an error of force shows as a steady difference and does not pile up.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant import state as s
from plant.compiled import compiled
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
    SERVO_SIZE,
    W_PEAK_TORQUE,
    W_RADIUS,
    WHEEL_SIZE,
)
from plant.plant import Plant
from plant.truth import PAYLOAD, TIME, Truth, observe
from plant.workspace import Workspace

Array = NDArray[np.float64]

# Columns of what was measured.
M_TORQUE: Final = 0  # four [N m]
M_BRAKING: Final = 4  # above zero while the brakes are applied
M_SPEED: Final = 5  # mean wheel speed [rad/s]
M_ARTICULATION: Final = 6  # angle [rad], rate [rad/s]
M_LIFT: Final = 8
M_TILT: Final = 10
MEASURED: Final = 12

AT_ONCE: Final = 2e-3  # lag of motors and brakes whose torque was measured [s]
SERVO_LAG: Final = 0.02  # of joints whose angle was measured [s]
ANGLE_GAIN: Final = 4.0  # how fast an error of such an angle decays [1/s]
HELD: Final = 0.05  # wheel speed below which an applied brake holds the wheels [rad/s]


@compiled
def _command(command: Array, state: Array, m: Array, after: Array, interval: float, p: Array) -> None:
    """Commands that make the plant do what was measured from one row to the next."""
    for wheel in range(4):
        torque, capacity = 0.5 * (m[M_TORQUE + wheel] + after[M_TORQUE + wheel]), 0.0
        if m[M_BRAKING] > 0.0:
            capacity = p[P_BRAKE_CAPACITY] if abs(m[M_SPEED]) < HELD else abs(torque)
            torque = 0.0
        command[s.C_DRIVE + wheel], command[s.C_BRAKE + wheel] = torque, capacity
    for at, body, rate in (
        (M_ARTICULATION, s.FRONT_FRAME, s.C_ARTICULATION_RATE),
        (M_LIFT, s.LIFT_ARM, s.C_LIFT_RATE),
        (M_TILT, s.BUCKET, s.C_TILT_RATE),
    ):
        change = after[at + 1] - m[at + 1]
        lead_in = m[at + 1] + (0.5 + SERVO_LAG / interval) * change  # a lagging servo is asked for more
        command[rate] = lead_in + ANGLE_GAIN * (m[at] - state[s.JOINT + body])


@compiled
def _draw(state: Array, work: Workspace, m: Array, radius: float, share: float) -> None:
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


@compiled
def lead(
    state: Array,
    measured: Array,
    p: Array,
    step: float,
    count: int,
    gain: float,
    work: Workspace,
    active: Array | None,
    measures: Array,
    rows: Array,
) -> None:
    """Fill `rows` (n, Truth.size); `count` steps between rows."""
    command = np.zeros(s.COMMANDS)
    radius = p[P_WHEELS + W_RADIUS]
    for k in range(measured.shape[0]):
        observe(rows[k], state, command, p, work, active, measures)
        after = measured[min(k + 1, measured.shape[0] - 1)]
        _command(command, state, measured[k], after, count * step, p)
        rows[k, TIME] = k * count * step
        advance(state, command, p, step, count, False, work, active)
        _draw(state, work, after, radius, gain * count * step)
        if not math.isfinite(state[s.POSITION]):
            break


def led_parameters(p: Array) -> Array:
    """The plant's parameters with joints, motors and brakes that do what was measured."""
    led = p.copy()
    for at in (P_STEERING, P_LIFT, P_TILT):
        servo = led[at : at + SERVO_SIZE]
        servo[:2] = -math.pi, math.pi  # measured angles may pass the stops by their error
        servo[2:4] = 1e3
        servo[4] = SERVO_LAG
    led[P_DRIVE_LAG] = led[P_BRAKE_LAG] = AT_ONCE
    led[P_DRIVE_RATE] = 1e12
    for wheel in range(4):
        led[P_WHEELS + wheel * WHEEL_SIZE + W_PEAK_TORQUE] = 1e9
    return led


@dataclass(frozen=True, slots=True)
class Led:
    """What the plant did, as rows of Truth; `whole` is False where the motion diverged (the rest is not a number)."""

    rows: Array
    whole: bool


def follow(
    plant: Plant, measured: Array, *, interval_s: float, step_s: float = 1e-3, gain: float = 0.5
) -> Led:
    """Lead a plant at its start through `measured` (n, MEASURED), one row every `interval_s`.

    gain: with which the speed is drawn to the measured one [1/s]. The plant itself stays as it is.
    """
    state, p, work, active, measures = plant.inside()
    rows = np.full((len(measured), Truth.size), np.nan)
    count = round(interval_s / step_s)
    lead(state, measured, led_parameters(p), step_s, count, gain, work, active, measures, rows)
    rows[:, PAYLOAD] = plant.payload_mass
    slip_angle = Truth.slip_angle.column(rows)
    np.arctan(slip_angle, out=slip_angle)
    return Led(rows, bool(np.isfinite(rows[-1]).all()))
