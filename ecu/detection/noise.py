"""Noise and tolerated offset of every residual, from those of its signals by its equation.

They depend on the machine's parameters, which a tool may change while the ECU runs. Plain arithmetic: it is written out in C as well.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.detection.layout import (
    ACROSS,
    ALONG,
    ANGLE_RATE,
    BUCKET_LOAD,
    FRONT_TORQUES,
    NOISE,
    PITCH_GYRO,
    PITCH_RATES,
    REAR_TORQUES,
    ROLL_GYRO,
    SPEEDS,
    STEERING_LINES,
    TOLERANCE,
    TRACTION,
    UPWARDS,
    YAW_STEERING,
)
from ecu.detection.machine import OBSERVED, effective_radius, machine_mass
from ecu.detection_rules import DetectionRules, Sensor, Tolerances
from ecu.estimators.parameters import GRAVITY, Parameters

Floats = NDArray[np.float64]


class Makes(NamedTuple):
    """The sensors whose noise and offsets go into residuals, one of each family."""

    articulation_angle: Sensor
    articulation_rate: Sensor
    wheel_speed: Sensor
    wheel_torque: Sensor
    specific_force: Sensor
    angular_rate: Sensor
    slope: Sensor
    pressure: Sensor


def makes_of(rules: DetectionRules) -> Makes:
    """Those of a calibration."""
    return Makes(**{family: rules.sensors[family] for family in Makes._fields})


def of_residuals(rules: Floats, s: Makes, t: Tolerances, p: Parameters) -> None:
    """Writes the rows NOISE and TOLERANCE of the rules; the others depend on the sensors alone."""
    noise, offset = rules[NOISE], rules[TOLERANCE]
    g = p.geometry
    angle, rate, wheel, torque = s.articulation_angle, s.articulation_rate, s.wheel_speed, s.wheel_torque
    force, gyro, slope, pressure = s.specific_force, s.angular_rate, s.slope, s.pressure
    radius, track, mass = effective_radius(p), (g.front_track + g.rear_track) / 2.0, machine_mass(p)
    base = g.front_length + g.rear_length
    upright = t.gain * GRAVITY  # of axes that are not quite at right angles
    # an observer of OBSERVED seconds turns an offset of the rate into one of the angle
    noise[ANGLE_RATE], offset[ANGLE_RATE] = angle.noise, rate.offset * OBSERVED + angle.onset
    noise[ROLL_GYRO], offset[ROLL_GYRO] = slope.noise, gyro.offset * OBSERVED + slope.onset
    noise[PITCH_GYRO], offset[PITCH_GYRO] = slope.noise, gyro.offset * OBSERVED + slope.onset
    noise[PITCH_RATES], offset[PITCH_RATES] = 1.5 * gyro.noise, gyro.offset
    for j in range(SPEEDS, SPEEDS + 6):
        noise[j] = 1.5 * wheel.noise * radius + gyro.noise * track
        offset[j] = wheel.offset * radius + (gyro.offset + rate.offset) * track
    noise[YAW_STEERING] = gyro.noise + rate.noise * g.front_length / base
    offset[YAW_STEERING] = 3.0 * gyro.offset + rate.offset + wheel.onset / 2.0 * radius / base
    noise[ALONG], offset[ALONG] = force.noise, force.offset + slope.offset * GRAVITY + upright
    noise[ACROSS], offset[ACROSS] = force.noise, force.offset + slope.offset * GRAVITY + upright
    noise[UPWARDS], offset[UPWARDS] = 1.5 * force.noise, force.offset + upright
    noise[FRONT_TORQUES], offset[FRONT_TORQUES] = 1.5 * torque.noise, torque.offset
    noise[REAR_TORQUES], offset[REAR_TORQUES] = 1.5 * torque.noise, torque.offset
    noise[TRACTION] = 2.0 * torque.noise / radius + mass * force.noise
    offset[TRACTION] = torque.offset / radius + mass * force.offset
    lever = 0.3 * p.tilt_linkage.head_area
    noise[BUCKET_LOAD], offset[BUCKET_LOAD] = 1.5 * pressure.noise * lever, pressure.offset * lever
    noise[STEERING_LINES], offset[STEERING_LINES] = pressure.noise, pressure.offset
