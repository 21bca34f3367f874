"""The driver: follows the script with pedals and joystick, as fast as hands and feet go.

Speed is held by a PI law on the measured speed; what opposes the motion goes to retardation first and to the
brake beyond it. Articulation follows the script's angle by its slope plus a proportional correction.
Pedals and joystick move at bounded rates. While limits of the machine act against the driver, the pedal is held and the integral does not grow
(anti-windup). While the script itself brakes, the accelerator is up.

Pure: state in, state out.
"""

import math
from typing import NamedTuple

from configuration import CheckedTable
from plant.compiled import ruled
from plant.unit.script import DEGREE, Wish


class DriverParameters(NamedTuple):
    """SI; demands are shares of full demand."""

    speed_gain: float  # torque share per m/s of error
    speed_integral: float  # torque share per m/s of error and s
    retardation: float  # largest torque share against the motion; beyond it the brake
    accelerator_rate: float  # 1/s
    brake_rate: float  # 1/s
    articulation_gain: float  # 1/s
    articulation_rate: float  # full joystick [rad/s]
    articulation_acceleration: float  # joystick movement [rad/s2]
    standstill_speed: float = 0.15  # below it, with no speed wanted, the brake holds [m/s]
    holding_brake: float = 0.3


class Demand(NamedTuple):
    """The driver's demand, before any limit."""

    torque: float = 0.0  # share of full drive torque, -1..1; negative: reverse
    brake: float = 0.0  # share of full service braking, 0..1
    articulation_rate: float = 0.0  # rad/s, left +
    lift: float = 0.0  # share of full speed, -1..1, up +
    tilt: float = 0.0  # share of full speed, -1..1, roll back +


class DriverState(NamedTuple):
    """Where pedals and joystick are, and the integral of the speed law."""

    demand: Demand = Demand()
    integral: float = 0.0  # torque share


@ruled
def drive(
    state: DriverState,
    parameters: DriverParameters,
    wish: Wish,
    speed: float,
    articulation_angle: float,
    dt: float,
    held_back: bool = False,
) -> DriverState:
    """The driver `dt` seconds later; `speed` [m/s] and `articulation_angle` [rad] as measured.

    held_back: whether limits reduced the demand of the pedals.
    """
    torque, brake, integral = _pedals(state, parameters, wish, speed, dt, held_back)
    rate = _joystick(parameters, wish, articulation_angle)
    torque_before, brake_before, rate_before, _, _ = state.demand
    demand = Demand(
        _towards(torque_before, torque, parameters.accelerator_rate * dt),
        _towards(brake_before, max(brake, wish.brake), parameters.brake_rate * dt),
        _towards(rate_before, rate, parameters.articulation_acceleration * dt),
        wish.lift,
        wish.tilt,
    )
    return DriverState(demand, integral)


@ruled
def _pedals(
    state: DriverState, p: DriverParameters, wish: Wish, speed: float, dt: float, held_back: bool
) -> tuple[float, float, float]:
    """Accelerator share, brake share and the new integral."""
    if wish.brake > 0:
        return 0.0, 0.0, 0.0  # the integral starts anew: it belonged to the speed before the brake
    if math.isnan(wish.speed):
        return wish.torque, 0.0, 0.0
    if wish.speed == 0 and abs(speed) < p.standstill_speed:
        # a torque law would hunt about zero speed, and on a slope it would have to push for ever
        return 0.0, p.holding_brake, 0.0
    error = wish.speed - speed
    wanted = p.speed_gain * error + state.integral
    # no more pedal where it has no effect: at its stop, or under a limit (anti-windup)
    saturated = (abs(wanted) > 1 or held_back) and wanted * error > 0
    integral = state.integral if saturated else state.integral + p.speed_integral * error * dt
    if wanted * speed >= 0:
        return _within(wanted, 1.0), 0.0, integral
    # against the motion: motors first, for they do not heat, and only the rest with the brake
    return _within(wanted, p.retardation), min(max(abs(wanted) - p.retardation, 0.0), 1.0), integral


@ruled
def _joystick(p: DriverParameters, wish: Wish, angle: float) -> float:
    """Wanted articulation rate [rad/s]."""
    if math.isnan(wish.articulation_angle):
        return _within(wish.articulation_rate, p.articulation_rate)
    # the slope of the script leads, so that a constant rate is followed without a lasting error of angle
    correction = p.articulation_gain * (wish.articulation_angle - angle)
    return _within(wish.articulation_angle_rate + correction, p.articulation_rate)


@ruled
def _within(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)


@ruled
def _towards(value: float, target: float, step: float) -> float:
    # _within, written out: three times per tick
    return value + min(max(target - value, -step), step)


def read_driver(table: CheckedTable) -> DriverParameters:
    """The [driver] table of an equipment file."""

    def percent(key: str, high: float) -> float:
        return table.number(key, unit="%", low=0.0, high=high) / 100

    parameters = DriverParameters(
        speed_gain=percent("speed_gain_percent_per_m_s", 1000.0),
        # per (m/s) and s, hence per m
        speed_integral=percent("speed_integral_percent_per_m", 1000.0),
        retardation=percent("retardation_percent", 100.0),
        accelerator_rate=percent("accelerator_rate_percent_s", 10_000.0),
        brake_rate=percent("brake_rate_percent_s", 10_000.0),
        articulation_gain=table.number("articulation_gain_per_s", unit="1/s", low=0.0, high=20.0),
        articulation_rate=table.number("articulation_rate_deg_s", unit="deg/s", low=1.0, high=80.0) * DEGREE,
        articulation_acceleration=table.number(
            "articulation_acceleration_deg_s2", unit="deg/s2", low=1.0, high=2000.0
        )
        * DEGREE,
    )
    table.finish()
    return parameters
