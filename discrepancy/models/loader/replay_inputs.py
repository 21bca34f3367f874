"""Inputs of the measurement-driven replay: recorded inputs without the errors of their sensors and with little of their noise.

Where the driver's demand was recorded, the demand through the lags of the sheet carries the fast part of a signal, which no filter
could separate from noise. The smoothed difference to the sensor adds what limits or the machine changed of it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_coeffs, savgol_filter
from scipy.stats import trim_mean

from discrepancy.model.description import Window
from discrepancy.model.sensors import delayed
from discrepancy.models.loader.channels import RATE_ZERO_SD, SPEEDS, TORQUE_SCALE_SD, TORQUES
from discrepancy.models.loader.nuisances import TORQUE_ERRORS
from discrepancy.signals.recording import Array
from plant.compiled import compiled
from plant.replay import (
    M_ARTICULATION,
    M_BRAKING,
    M_LIFT,
    M_SPEED,
    M_TILT,
    M_TORQUE,
    M_TURNING,
    MEASURED,
    Demanded,
)
from plant.sheets.machine import Lift, Machine, Tilt
from plant.unit.actuators import Abilities
from plant.unit.sensor_parameters import ChannelParameters, SensorParameters

SMOOTHED: Final = 11  # grid points (10 ms each) of the quadratic filter for articulation and wheel speed
LEVELLED: Final = 51  # the same for the linkage's angles, and for differences to the driver's demand
ROLLS: Final = 0.1  # wheel speed from which on a brake's friction is that of a rolling wheel [rad/s]
RATE_SCALE_SD: Final = 0.01  # of the scale error of a rate sensor
AROUND: Final = 201  # grid points over which the power of a difference is taken
BY_CHANCE: Final = 4.0  # multiple of its mean power that noise alone exceeded there at 6 of 100 000 points
EVENTS: Final = 0.03  # share of the differences at either end that an offset is taken without: limits, and the start of a drive
QUARTILE: Final = (
    0.6745  # of the normal distribution: the median of deviations is that many standard deviations
)
TINY: Final = 1e-12
DEMANDS: Final = ("articulation_rate_demand", "lift_demand", "tilt_demand")
"""In the order of plant.replay.JOINTS."""
SPEED_FAULTS: Final = ("scale", "delay")
"""Faults of a wheel speed sensor. They also disturb the replay, since its feedback follows the measured speed."""
LINKAGE: Final = ((M_LIFT, "lift_arm_angle", "lift_zero"), (M_TILT, "tilt_angle", "tilt_zero"))
"""Joints of the linkage: column of the replay's input, channel, nuisance that is its zero point."""

Speeds = Mapping[str, Array]
"""Wheel speeds [rad/s] by channel."""


@dataclass(frozen=True, slots=True)
class ReplayInputs:
    """Measured inputs of the segments of one recording, one segment after the other."""

    measured: Array  # (n, MEASURED), columns of plant.replay
    speeds: Speeds  # measured wheel speeds (n,) by channel [rad/s]
    edges: NDArray[np.intp]  # first row of each segment, and the end of the last one
    demanded: Demanded  # by joint of plant.replay.JOINTS: whether its rate is the demanded one, else it is the measured one
    payload: float  # [kg]
    step_s: float  # between rows
    torque_sd: Array  # (n, 2): by how much the torque of every wheel may be off [N m], one standard deviation each: `torque_errors`


def replay_inputs(
    windows: Sequence[Window], machine: Machine, sensors: SensorParameters, abilities: Abilities
) -> ReplayInputs:
    """Inputs of the windows of one recording; at least one window."""
    speeds, demanded = [wheel_speeds(window, sensors) for window in windows], demanded_joints(windows[0])
    parts = [
        measured_rows(window, own, sensors, machine, abilities, demanded=demanded)
        for window, own in zip(windows, speeds, strict=True)
    ]
    return ReplayInputs(
        measured=np.concatenate(parts),
        speeds={name: np.concatenate([own[name] for own in speeds]) for name in speeds[0]},
        edges=np.cumsum([0, *(len(part) for part in parts)]).astype(np.intp),
        demanded=demanded,
        payload=windows[0].constants.get("payload", 0.0),
        step_s=windows[0].step_s,
        torque_sd=np.concatenate([torque_errors(window, machine, abilities) for window in windows]),
    )


def demanded_joints(window: Window) -> Demanded:
    """Whether the driver's demand was recorded, for each of plant.replay.JOINTS."""
    steering, lift, tilt = (window.has(name) for name in DEMANDS)
    return steering, lift, tilt


def wheel_speeds(window: Window, sensors: SensorParameters) -> Speeds:
    """Measured wheel speeds [rad/s], smoothed, with the sensors' lag and delay removed."""
    return {
        name: _smooth(delayed(window[name], -_lateness_s(sensors.of(name), window.step_s), window.time_s))
        for name in SPEEDS
        if window.has(name)
    }


def measured_rows(
    window: Window,
    speeds: Speeds,
    sensors: SensorParameters,
    machine: Machine,
    abilities: Abilities,
    *,
    demanded: Demanded,
) -> Array:
    """Input rows of plant.replay (n, MEASURED) for one window.

    Lags and delays of the sheet are removed by reading a signal as much later as they delay slow motions.
    speeds: from `wheel_speeds`; demanded: joints whose rate is the driver's demand.
    """

    def read(name: str) -> Array:
        return delayed(window[name], -_lateness_s(sensors.of(name), window.step_s), window.time_s)

    rows = np.zeros((window.time_s.size, MEASURED))
    nominal = _demanded_torque(window, machine, abilities)
    for i, name in enumerate(TORQUES):
        rows[:, M_TORQUE + i] = _with_difference(nominal[:, i], read(name))
    if window.has("brake_demand"):
        rows[:, M_BRAKING] = window["brake_demand"] > 0.0
    rows[:, M_SPEED] = np.mean(list(speeds.values()), axis=0) if speeds else 0.0
    for i, name in enumerate(SPEEDS):
        rows[:, M_TURNING + i] = speeds.get(name, rows[:, M_SPEED])
    angle = read("articulation_angle")
    rate = _without_offset(read("articulation_rate"), angle, sensors.of("articulation_angle"), window.step_s)
    rows[:, M_ARTICULATION : M_ARTICULATION + 2] = np.stack(
        _steering(window, machine, angle, rate, demanded=demanded[0]), axis=1
    )
    lift, tilt = machine.lift, machine.tilt
    servos: tuple[Lift | Tilt, ...] = (lift, tilt)
    demands: list[Array | None] = [None, None]
    if demanded[1]:
        rate = _lever_rate(window, DEMANDS[1], lift.lower_rate_limit, lift.raise_rate_limit)
        demands[0] = _permitted(window, rate, "lift_down_limit", "lift_up_limit")
    if demanded[2]:
        rate = _lever_rate(window, DEMANDS[2], tilt.rate_limit, tilt.rate_limit)
        demands[1] = _permitted(window, rate, "tilt_forward_limit", "tilt_back_limit")
    for (column, name, _), servo, demand in zip(LINKAGE, servos, demands, strict=True):
        rows[:, column : column + 2] = np.stack(_servo(read(name), servo, demand, window.step_s), axis=1)
    return rows


def without_sensor_errors(inputs: ReplayInputs, values: Mapping[str, float]) -> Array:
    """Input rows (n, MEASURED) corrected for sensor errors of given size: nuisances of torque and angles, faults of wheel speeds.

    values: of the model's parameters by name; a missing one counts as 0.
    """
    rows = inputs.measured.copy()
    errors = [values.get(p.name, 0.0) for p in TORQUE_ERRORS]
    if any(errors):
        rows[:, M_TORQUE : M_TORQUE + 4] += (inputs.torque_sd @ errors)[:, None]
    rows[:, M_TORQUE : M_TORQUE + 4] /= 1.0 + values.get("torque_scale", 0.0)
    rows[:, M_ARTICULATION] -= values.get("articulation_zero", 0.0)
    for column, _, name in LINKAGE:
        rows[:, column] -= values.get(name, 0.0)
    for name, speed in inputs.speeds.items():
        scale, delay_s = (values.get(f"{name}.{fault}", 0.0) for fault in SPEED_FAULTS)
        if scale or delay_s:
            true = _undelayed(speed, inputs, delay_s) / (1.0 + scale)
            rows[:, M_SPEED] -= (speed - true) / len(inputs.speeds)
    return rows


def _undelayed(values: Array, inputs: ReplayInputs, delay_s: float) -> Array:
    """A signal before a delay, each segment by itself; its last value is held."""
    parts = [values[a:b] for a, b in pairwise(inputs.edges)]
    return np.concatenate(
        [delayed(part, -delay_s, inputs.step_s * np.arange(part.size, dtype=np.float64)) for part in parts]
    )


def _lever_rate(window: Window, lever: str, falling: float, rising: float) -> Array:
    """The rate [rad/s] that a lever demands; its signal is a share of the fastest rate down (negative) or up."""
    share = window[lever]
    return np.asarray(share * np.where(share > 0.0, rising, falling), float)


def _permitted(window: Window, rate: Array, falling: str, rising: str) -> Array:
    """A demanded rate [rad/s] as far as the limits permit that were in force; a limit that was not recorded does not bound it."""
    low = -window[falling] if window.has(falling) else -math.inf
    return np.asarray(np.clip(rate, low, window[rising] if window.has(rising) else math.inf), float)


class _Cylinder(NamedTuple):
    """The limits and lags between a demanded and an achieved rate."""

    lower: float  # stops [rad]
    upper: float
    lag_s: float
    cushion_s: float  # time constant of the end cushions


def _steering(
    window: Window, machine: Machine, angle: Array, rate: Array, *, demanded: bool
) -> tuple[Array, Array]:
    """Articulation angle [rad] and rate [rad/s]: from the driver's demand where that was recorded, else smoothed."""
    if not demanded:
        return _smooth(angle), _smooth(rate)
    limit, steering = "articulation_rate_limit", machine.steering
    demand = _permitted(window, window[DEMANDS[0]], limit, limit)
    cylinder = _Cylinder(
        -steering.limit, steering.limit, steering.time_constant, steering.cushion_time_constant
    )
    return (
        _driven_angle(angle, demand, cylinder, window.step_s),
        _executed_rate(demand, rate, cylinder.lag_s, window.step_s),
    )


def _servo(angle: Array, servo: Lift | Tilt, demand: Array | None, step_s: float) -> tuple[Array, Array]:
    """Angle [rad] and rate [rad/s] of a joint of the linkage: from the lever's demand where that was recorded, else smoothed."""
    if demand is None:
        return _smooth(angle, LEVELLED), _smooth(angle, LEVELLED, rate_of=step_s)
    cylinder = _Cylinder(
        servo.lower_limit, servo.upper_limit, servo.time_constant, servo.cushion_time_constant
    )
    return _driven_angle(angle, demand, cylinder, step_s), demand


def _without_offset(rate: Array, angle: Array, sheet: ChannelParameters, step_s: float) -> Array:
    """A measured rate less the zero error of its sensor, which the angle shows.

    Both drive the replay: with the zero error, a machine that stands on locked wheels is turned at its joint until its tyres hold it.
    The integral of the rate is fitted to the angle with an offset and a scale error. sheet: of the angle's sensor.
    """
    time = step_s * np.arange(angle.size)
    turned = np.cumsum(rate) * step_s
    columns = np.stack([np.ones_like(time), time - time.mean(), turned - turned.mean()], axis=1)
    # In an even turn offset and scale do the same to the integral; what sensors usually have decides there.
    noise = math.hypot(sheet.noise, sheet.resolution / math.sqrt(12.0))
    usual = np.diag([0.0, noise / RATE_ZERO_SD, noise / RATE_SCALE_SD])
    found, *_ = np.linalg.lstsq(
        np.concatenate([columns, usual]), np.concatenate([turned - angle, np.zeros(3)]), rcond=None
    )
    return np.asarray(rate - found[1], float)


def _driven_angle(angle: Array, demand: Array, cylinder: _Cylinder, step_s: float) -> Array:
    """Angle of a joint whose cylinder executes a demanded rate; the smoothed difference to the sensor is added."""
    room = _smooth(angle)
    braked = np.clip(
        demand, (cylinder.lower - room) / cylinder.cushion_s, (cylinder.upper - room) / cylinder.cushion_s
    )
    rate = first_order_lag(braked[:, None], cylinder.lag_s, math.inf, step_s)[:, 0]
    # trapezoidal sum of the rate, so that no half step of delay is left
    nominal = step_s * (np.cumsum(rate) - 0.5 * rate)
    return np.asarray(nominal + _smooth(angle - nominal, LEVELLED), float)


def _executed_rate(demand: Array, rate: Array, lag_s: float, step_s: float) -> Array:
    """The rate that a cylinder of this lag executed: the driver's demand, corrected slowly for what limits took off.

    rate: as measured. A lag's input is its output plus lag times slope, here with the noise of the sensor, hence the smoothing. A row's
    demand has acted since the row before, so that the mean of two neighbours acts at a row.
    """
    acting = 0.5 * (demand + np.append(demand[1:], demand[-1]))
    executed = rate + lag_s * np.gradient(rate, step_s)
    return np.asarray(demand + _smooth(executed - acting, LEVELLED), float)


def _with_difference(nominal: Array, measured: Array) -> Array:
    """A torque from the pedals, corrected by its difference to the sensor as far as that is more than noise [N m].

    Noise that is left in an input makes the machine seem to follow it by a part only (regression dilution): on a drive with hardly any
    torque the motors were said to deliver half of it. So offset and factor are taken from the whole, and what then is left is smoothed, and
    kept where it is larger than noise is after that smoothing. Pedals have no noise, so the factor is not diluted itself.
    """
    noise = _noise(measured - nominal)
    varying = nominal - nominal.mean()
    factor = varying @ (measured - nominal) / (varying @ varying + (noise / TORQUE_SCALE_SD) ** 2 + TINY)
    level = nominal + factor * varying
    level += trim_mean(measured - level, EVENTS)
    # mirrored ends: a repeated last sample would carry half of its own noise into the result
    odd = _odd(LEVELLED, measured)
    rest = savgol_filter(measured - level, odd, 2, mode="mirror")
    left = noise**2 * float(np.sum(savgol_coeffs(odd, 2) ** 2))
    power = uniform_filter1d(rest**2, min(AROUND, rest.size), mode="mirror")
    return np.asarray(
        level + rest * np.clip(1.0 - (BY_CHANCE * left / (power + TINY)) ** 2, 0.0, None), float
    )


def torque_errors(window: Window, machine: Machine, abilities: Abilities) -> Array:
    """Standard deviations (n, 2) [N m] of what `_with_difference` takes from the whole of a window: its offset, and its factor times the torque.

    Both come from noisy torques and are the same in the whole window, so that no window shows how far off they are. Wheels turn together:
    of four independent errors only the sum moves the machine, and every wheel gets a quarter of its standard deviation.
    """
    nominal = _demanded_torque(window, machine, abilities)
    varying = nominal - nominal.mean(axis=0)
    noise = np.array([_noise(window[name] - nominal[:, i]) for i, name in enumerate(TORQUES)])
    offset = np.full(len(nominal), math.hypot(*noise) / math.sqrt(len(nominal)))
    factors = noise / np.sqrt(np.sum(varying**2, axis=0) + (noise / TORQUE_SCALE_SD) ** 2 + TINY)
    factor = np.sqrt(np.sum((factors * varying) ** 2, axis=1)) * np.sign(np.sum(varying, axis=1))
    return np.stack([offset, factor], axis=1) / len(TORQUES)


def _noise(signal: Array) -> float:
    """Standard deviation of the noise of a signal that moves little from row to row."""
    return float(np.median(np.abs(np.diff(signal)))) / (math.sqrt(2.0) * QUARTILE)


def _demanded_torque(window: Window, machine: Machine, abilities: Abilities) -> Array:
    """Wheel torque (n, 4) [N m] that the pedals demand, through the lags of motors and brakes; 0 where no pedal was recorded.

    A row's pedals have acted since the row before. Torque limits beyond the drive's power are not modelled here.
    """
    torque = np.zeros((window.time_s.size, 4))
    speed = np.stack([window[name] if window.has(name) else torque[:, 0] for name in SPEEDS], axis=1)
    if window.has("torque_demand"):
        most = np.minimum(
            1.0, abilities.drive_power / np.maximum(np.abs(speed) * abilities.drive_torque, 1.0)
        )
        demand = np.clip(window["torque_demand"][:, None], -most, most) * abilities.drive_torque
        drive = machine.drive
        torque += first_order_lag(demand, drive.time_constant, drive.rate_limit, window.step_s)
    if window.has("brake_demand"):
        demand = window["brake_demand"][:, None] * np.array(abilities.brake_torque)
        friction = first_order_lag(demand, machine.brake.time_constant, math.inf, window.step_s)
        torque -= friction * np.tanh(speed / ROLLS)
    return torque


@compiled
def first_order_lag(demand: Array, lag_s: float, rate: float, step_s: float) -> Array:
    """Output (n, k) of a first-order lag with a limited rate [1/s]; a row's demand (n, k) has acted since the row before."""
    output = demand.copy()
    gained, most = 1.0 - math.exp(-step_s / lag_s), rate * step_s
    for row in range(1, len(demand)):
        for k in range(demand.shape[1]):
            change = gained * (demand[row, k] - output[row - 1, k])
            output[row, k] = output[row - 1, k] + min(max(change, -most), most)
    return output


def _smooth(values: Array, points: int = SMOOTHED, *, rate_of: float | None = None) -> Array:
    """Centred quadratic filter over `points`; its slope per second where rate_of gives the step [s]."""
    odd = _odd(points, values)
    order, delta = (0, 1.0) if rate_of is None else (1, rate_of)
    return np.asarray(savgol_filter(values, odd, 2, deriv=order, delta=delta, mode="nearest"), np.float64)


def _odd(points: int, values: Array) -> int:
    """Length of a centred filter: `points`, or what the values allow."""
    return min(points, values.size // 2 * 2 - 1)


def kept_share(lag_s: float, step_s: float) -> float:
    """Share of its last value that a sampled sensor of this lag keeps; samples count as held (plant.unit.sensors)."""
    return math.exp(-step_s / lag_s) if lag_s > 0.0 else 0.0


def _lateness_s(sheet: ChannelParameters, step_s: float) -> float:
    """Delay of slow motions through a sensor's lag and delay [s]."""
    kept = kept_share(sheet.lag, step_s)
    # a sampled low-pass with pole k delays slow signals by k / (1 - k) samples, slightly less than its time constant
    return step_s * kept / (1.0 - kept) + sheet.delay
