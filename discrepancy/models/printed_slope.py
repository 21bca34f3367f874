"""Slope for the printed estimators: the inclination sensor's recorded reading without what accelerations add to it (ADR 44).

The correction is that of the ECU (`ecu.estimators.inclination`), with the acceleration of the rear axle by its own wheels.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.signals.recording import Array, Recording, Signal, cleaned
from discrepancy.signals.resampling import resampled
from ecu.calibration import load_calibration
from ecu.estimators.inclination import Slope, lean_at_start, leaned, without
from ecu.estimators.tyres.wheels import radius

SLOPE: Final = ("pitch_angle", "roll_angle")
NEEDED: Final = (*SLOPE, "yaw_rate", "wheel_speed_rear_left", "wheel_speed_rear_right")


def without_lean(run: Recording) -> Mapping[str, Signal]:
    """The run's signals with the slope itself; as they are where a signal that the correction needs is missing."""
    needed = {name: item for name, item in run.signals.items() if name in NEEDED}
    # damaged samples stay in the run, whose reader complains of them, but none may spoil what follows it
    sound, _ = cleaned(Recording(run.name, needed))
    if len(needed) < len(NEEDED) or any(item.time_s.size < 2 for item in sound.signals.values()):
        return run.signals
    time_s = sound.signals["pitch_angle"].time_s
    lean = _lean(time_s, *(resampled(sound.signals[name], time_s) for name in NEEDED))
    freed = {}
    for name, errors in zip(SLOPE, lean.T, strict=True):
        reading = run.signals[name]
        freed[name] = replace(reading, value=reading.value - np.interp(reading.time_s, time_s, errors))
    return {**run.signals, **freed}


def _lean(time_s: Array, pitch: Array, roll: Array, yaw_rate: Array, left: Array, right: Array) -> Array:
    """Pitch and roll that accelerations add to each reading, (n, 2) [rad]; left, right: speeds of the rear wheels [rad/s]."""
    p = load_calibration("l60").parameters
    # the rear axle goes straight ahead in the frame that bears the sensor
    speed = (left + right) / 2.0 * radius(p.wheel.nominal_load, 1.0, p.wheel)
    sensor = p.geometry.rear_length + p.sensors.imu_x  # ahead of that axle
    ahead = np.gradient(speed, time_s) - yaw_rate**2 * sensor
    aside = speed * yaw_rate + np.gradient(yaw_rate, time_s) * sensor
    found = np.empty((time_s.size, 2))
    lean = lean_at_start(aside[0])
    rows = zip(pitch, roll, ahead, aside, np.diff(time_s, append=time_s[-1]), strict=True)
    for k, (nose_down, left_up, x, y, dt) in enumerate(rows):
        found[k] = lean
        slope = without(Slope(nose_down, left_up), lean)
        lean = leaned(lean, slope, x, y, dt, p.sensors.slope_levelling)
    return found
