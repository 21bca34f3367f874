"""Rules of the detection for one machine: from what the calibration says of its sensors to thresholds.

A sensor is described by noise, resolution, the offset it may have when it is sound, and the largest innovation that the
machine gives it when something sets in. Noise and offsets of the residuals follow by their equations (`ecu.detection.noise`);
the height of the sequential tests follows from the false-alarm rate.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from configuration import ConfigurationError
from ecu.detection.layout import CYCLES, FREEZE, JUMP, ONSET, RESIDUALS, RULES, STIRRED, WIDTH
from ecu.detection.noise import makes_of, of_residuals
from ecu.detection_rules import DetectionRules, Sensor
from ecu.estimators.parameters import Parameters
from ecu.watched import NAMES

Floats = NDArray[np.float64]
TICKS_PER_H: Final = 360_000.0
EULER: Final = 1.166
"""Siegmund's correction of a CUSUM's height for the overshoot of its last step."""


FAMILIES: Final[Mapping[str, str]] = {
    name: family
    for family, names in {
        "articulation_angle": ("articulation_angle",),
        "articulation_rate": ("articulation_rate",),
        "wheel_speed": tuple(f"wheel_speed_{n}" for n in range(1, 5)),
        "wheel_torque": tuple(f"wheel_torque_{n}" for n in range(1, 5)),
        "specific_force": tuple(f"specific_force_{axis}" for axis in "xyz"),
        "angular_rate": ("roll_rate", "pitch_rate", "yaw_rate", "slope_pitch_rate"),
        "slope": ("pitch", "roll"),
        "pressure": ("lift_pressure", "tilt_pressure"),
        "linkage_angle": ("lift_arm_angle", "tilt_angle"),
        "steering_pressure": ("steering_pressure_left", "steering_pressure_right"),
    }.items()
    for name in names
}
"""The make of every watched signal's sensor."""
PREDICTED: Final = 1.6
"""Standard deviation of an innovation over that of a sample: two samples, and the trend."""
STIRS: Final = 4.0
"""Standard deviations of an innovation from which on it says that the machine was stirred."""
NEVER: Final = 1e12
"""A threshold that nothing reaches, in any unit."""
UNSEEN: Final = 0.25
"""Share of an onset that a signal may show while no other shows anything."""


def height_for(per_hour: float) -> float:
    """Height of one CUSUM [standard deviations] so that all tests together give so many false alarms per hour.

    Siegmund's approximation of the run length of a one-sided CUSUM with drift 0.5: (e^x - 1 - x) / 0.5 for
    x = height + 1.166.
    """
    run_length = TICKS_PER_H * 2.0 * RESIDUALS / per_hour
    x = math.log(run_length * 0.5)
    for _ in range(20):  # e^x = 1 + x + run/2
        x = math.log(1.0 + x + run_length * 0.5)
    return x - EULER


def deviations_for(per_hour: float) -> float:
    """Standard deviations beyond which a single sample is no noise, for so many false alarms per hour of all signals."""
    from statistics import NormalDist

    return -NormalDist().inv_cdf(per_hour / (TICKS_PER_H * 2.0 * len(NAMES)))


def frames_for(per_hour: float, sensor: Sensor) -> float:
    """Equal samples in a row that noise does not give, for so many false alarms per hour."""
    alike = min(sensor.resolution / (2.0 * sensor.noise * math.sqrt(math.pi)), 0.5)
    return math.ceil(math.log(per_hour / (TICKS_PER_H * len(NAMES))) / math.log(alike))


def rules_array(rules: DetectionRules, cycles: Mapping[str, float], p: Parameters) -> Floats:
    """What the compiled detection needs, (RULES, WIDTH); cycles: between two samples of each signal."""
    found = np.zeros((RULES, WIDTH))
    share = rules.false_alarms / 3.0  # of samples, of standstills, of residuals
    for place, name in enumerate(NAMES):
        found[CYCLES, place] = cycles[name]
        if (
            name not in FAMILIES
        ):  # a signal whose sensor nobody has described: the checks of single signals stay
            found[[JUMP, ONSET, STIRRED, FREEZE], place] = NEVER
            continue
        if FAMILIES[name] not in rules.sensors:
            raise ConfigurationError(
                f"the calibration has no section [sensor_{FAMILIES[name]}]: the detection cannot watch {name} without its noise"
            )
        sensor = rules.sensors[FAMILIES[name]]
        innovation = PREDICTED * sensor.noise
        found[JUMP, place] = deviations_for(share) * innovation + UNSEEN * sensor.onset
        found[ONSET, place], found[STIRRED, place] = sensor.onset, STIRS * innovation
        found[FREEZE, place] = frames_for(share, sensor)
    of_residuals(found, makes_of(rules), rules.tolerances, p)
    return found
