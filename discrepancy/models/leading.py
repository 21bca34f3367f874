"""What leads the plant: the recorded inputs without what their sensors did to them, and without the most of their noise.

Where the driver's demand was recorded, what it asks for through the sheet's lags carries the quick part, which no filter could tell
from noise; the sensor tells, smoothed, what limits or the machine made of it.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from discrepancy.model import Window
from discrepancy.models.loader_library import SPEEDS, TORQUES
from discrepancy.recording import Array
from discrepancy.sensors import delayed
from plant.actuators import Abilities
from plant.compiled import compiled
from plant.follow import (
    M_ARTICULATION,
    M_BRAKING,
    M_LIFT,
    M_SPEED,
    M_TILT,
    M_TORQUE,
    M_TURNING,
    MEASURED,
    Asked,
)
from plant.machine import Lift, Machine, Tilt
from plant.sensors import ChannelParameters, SensorParameters

SMOOTHED: Final = 11  # grid points, of 10 ms, of the centred quadratic that smooths articulation and speed
LEVELLED: Final = 51  # the same of the linkage's angles and of what the driver's demands do not tell
ROLLS: Final = 0.1  # wheel speed from which a brake's friction is that of a rolling wheel [rad/s]
DEMANDS: Final = ("articulation_rate_demand", "lift_demand", "tilt_demand")
"""In the order of plant.follow.JOINTS."""
MISLEADING: Final = ("scale", "delay")
"""Faults of a wheel's speed sensor, which also leads the plant's speed."""
LINKAGE: Final = ((M_LIFT, "lift_arm_angle", "lift_zero"), (M_TILT, "tilt_angle", "tilt_zero"))


Speeds = Mapping[str, Array]
"""By the channel of a wheel's speed."""


def asked_of(window: Window) -> Asked:
    """Which joints' demands were recorded."""
    steering, lift, tilt = (window.has(name) for name in DEMANDS)
    return steering, lift, tilt


def measured_of(
    window: Window,
    speeds: Speeds,
    sensors: SensorParameters,
    machine: Machine,
    abilities: Abilities,
    *,
    asked: Asked,
) -> Array:
    """What leads the plant, (n, MEASURED): the recorded inputs without what their sensors did to them.

    Lags and delays of the sheet are undone by reading as much later as they make slow motions late.
    speeds: of `speeds_of`; asked: joints whose rates are those the driver asked for.
    """

    def read(name: str) -> Array:
        return delayed(window[name], -_late(sensors.of(name), window.step_s), window.time_s)

    measured = np.zeros((window.time_s.size, MEASURED))
    by_pedals = _nominal(window, machine, abilities)
    for i, name in enumerate(TORQUES):
        nominal = by_pedals[:, i]
        measured[:, M_TORQUE + i] = nominal + _smooth(read(name) - nominal, LEVELLED)
    if window.has("brake_demand"):
        measured[:, M_BRAKING] = window["brake_demand"] > 0.0
    measured[:, M_SPEED] = np.mean(list(speeds.values()), axis=0) if speeds else 0.0
    for i, name in enumerate(SPEEDS):
        measured[:, M_TURNING + i] = speeds.get(name, measured[:, M_SPEED])
    angle, rate = read("articulation_angle"), read("articulation_rate")
    steering = machine.steering
    if asked[0]:
        demand = window[DEMANDS[0]]
        ends = _Ends(-steering.limit, steering.limit, steering.time_constant, steering.cushion_time_constant)
        measured[:, M_ARTICULATION] = _led_there(angle, demand, ends, window.step_s)
        measured[:, M_ARTICULATION + 1] = _obeyed(demand, rate, ends.lag_s, window.step_s)
    else:
        measured[:, M_ARTICULATION], measured[:, M_ARTICULATION + 1] = _smooth(angle), _smooth(rate)
    lift, tilt = machine.lift, machine.tilt
    servos: tuple[Lift | Tilt, ...] = (lift, tilt)
    demands = (
        _rate(window, DEMANDS[1], lift.lower_rate_limit, lift.raise_rate_limit) if asked[1] else None,
        _rate(window, DEMANDS[2], tilt.rate_limit, tilt.rate_limit) if asked[2] else None,
    )
    for (at, name, _), servo, turned in zip(LINKAGE, servos, demands, strict=True):
        angle = read(name)
        if turned is None:
            measured[:, at] = _smooth(angle, LEVELLED)
            measured[:, at + 1] = _smooth(angle, LEVELLED, rate_of=window.step_s)
        else:
            ends = _Ends(
                servo.lower_limit, servo.upper_limit, servo.time_constant, servo.cushion_time_constant
            )
            measured[:, at] = _led_there(angle, turned, ends, window.step_s)
            measured[:, at + 1] = turned
    return measured


def speeds_of(window: Window, sensors: SensorParameters) -> Speeds:
    """Speeds of the wheels that were recorded, as they lead the plant [rad/s]."""
    return {
        name: _smooth(delayed(window[name], -_late(sensors.of(name), window.step_s), window.time_s))
        for name in SPEEDS
        if window.has(name)
    }


def shifted(
    measured: Array, speeds: Speeds, edges: NDArray[np.intp], values: Mapping[str, float], step_s: float
) -> Array:
    """What was measured without what sensors are taken to add: those of torque and angles as nuisances, of wheel speeds as faults.

    speeds: of `speeds_of`; both one stretch after the other; edges: rows where stretches begin, and their end.
    """
    true = measured.copy()
    true[:, M_TORQUE : M_TORQUE + 4] /= 1.0 + values.get("torque_scale", 0.0)
    true[:, M_ARTICULATION] -= values.get("articulation_zero", 0.0)
    for at, _, name in LINKAGE:
        true[:, at] -= values.get(name, 0.0)
    for name, speed in speeds.items():
        scale, delay_s = (values.get(f"{name}.{fault}", 0.0) for fault in MISLEADING)
        if scale or delay_s:
            turned = _read_later(speed, edges, delay_s, step_s) / (1.0 + scale)
            true[:, M_SPEED] -= (speed - turned) / len(speeds)
    return true


def _read_later(values: Array, edges: NDArray[np.intp], by_s: float, step_s: float) -> Array:
    """Each stretch as it was before a delay; its ends stand still."""
    parts = [values[a:b] for a, b in pairwise(edges)]
    return np.concatenate(
        [delayed(part, -by_s, step_s * np.arange(part.size, dtype=np.float64)) for part in parts]
    )


def _rate(window: Window, lever: str, falling: float, rising: float) -> Array:
    """What a lever asks for [rad/s], from its share of the fastest rates down and up."""
    share = window[lever]
    return np.asarray(share * np.where(share > 0.0, rising, falling), float)


class _Ends(NamedTuple):
    """What a cylinder makes of a demand: its stops [rad], its lag and that of its cushions."""

    lower: float
    upper: float
    lag_s: float
    cushion_s: float


def _led_there(angle: Array, demand: Array, ends: _Ends, step_s: float) -> Array:
    """The angle of a joint whose cylinder is asked for a rate, and slowly what else moved it."""
    room = _smooth(angle)
    braked = np.clip(demand, (ends.lower - room) / ends.cushion_s, (ends.upper - room) / ends.cushion_s)
    rate = followed(braked[:, None], ends.lag_s, math.inf, step_s)[:, 0]
    nominal = step_s * (np.cumsum(rate) - 0.5 * rate)
    return np.asarray(nominal + _smooth(angle - nominal, LEVELLED), float)


def _nominal(window: Window, machine: Machine, abilities: Abilities) -> Array:
    """Torque at the wheels (n, 4) [N m] that the driver's pedals ask for, through the lags of motors and brakes; 0 where no pedal was recorded.

    A row's pedals have acted since the row before. What limits take off is not known here.
    """
    torque = np.zeros((window.time_s.size, 4))
    turning = np.stack([window[name] if window.has(name) else torque[:, 0] for name in SPEEDS], axis=1)
    if window.has("torque_demand"):
        most = np.minimum(
            1.0, abilities.drive_power / np.maximum(np.abs(turning) * abilities.drive_torque, 1.0)
        )
        asked = np.clip(window["torque_demand"][:, None], -most, most) * abilities.drive_torque
        drive = machine.drive
        torque += followed(asked, drive.time_constant, drive.rate_limit, window.step_s)
    if window.has("brake_demand"):
        asked = window["brake_demand"][:, None] * np.array(abilities.brake_torque)
        friction = followed(asked, machine.brake.time_constant, math.inf, window.step_s)
        torque -= friction * np.tanh(turning / ROLLS)
    return torque


@compiled
def followed(asked: Array, lag_s: float, rate: float, step_s: float) -> Array:
    """What a first-order lag with a limited rate [1/s] makes of what was asked for (n, k), held since the row before."""
    given = asked.copy()
    gained, most = 1.0 - math.exp(-step_s / lag_s), rate * step_s
    for row in range(1, len(asked)):
        for k in range(asked.shape[1]):
            change = gained * (asked[row, k] - given[row - 1, k])
            given[row, k] = given[row - 1, k] + min(max(change, -most), most)
    return given


def _obeyed(demand: Array, rate: Array, lag_s: float, step_s: float) -> Array:
    """The rate that cylinders of this lag were asked for: the driver's demand, and slowly what limits made of it.

    rate: as it was measured; with its slope times the lag it is what was asked for, with the sensor's noise. The demand of a row was
    held since the row before: at a row what acts is between it and the next.
    """
    acting = 0.5 * (demand + np.append(demand[1:], demand[-1]))
    obeyed = rate + lag_s * np.gradient(rate, step_s)
    return np.asarray(demand + _smooth(obeyed - acting, LEVELLED), float)


def _smooth(values: Array, points: int = SMOOTHED, *, rate_of: float | None = None) -> Array:
    """Centred quadratic over `points`; its slope per second where rate_of gives the step [s]."""
    odd = min(points, values.size // 2 * 2 - 1)
    order, delta = (0, 1.0) if rate_of is None else (1, rate_of)
    return np.asarray(savgol_filter(values, odd, 2, deriv=order, delta=delta, mode="nearest"), np.float64)


def kept_share(lag_s: float, step_s: float) -> float:
    """Share of its last value that a sampled sensor of this lag keeps; samples are taken to have been held (plant.sensors)."""
    return math.exp(-step_s / lag_s) if lag_s > 0.0 else 0.0


def _late(sheet: ChannelParameters, step_s: float) -> float:
    """By how much such a sensor is late for slow motions [s]."""
    kept = kept_share(sheet.lag, step_s)
    return step_s * kept / (1.0 - kept) + sheet.delay
