"""What faults do to the parameters of the sensors."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from plant.effects.effect import Parameter
from plant.unit.sensor_parameters import SensorParameters
from plant.unit.signals import (
    ANGULAR_RATE,
    ARTICULATION_ANGLE,
    ARTICULATION_RATE,
    CHANNELS,
    PRESSURE,
    SPECIFIC_FORCE,
    WHEEL_SPEED,
    WHEEL_TORQUE,
    WHEELS,
    Family,
)

DEGREE = math.pi / 180.0


def _channels(*families: Family) -> tuple[str, ...]:
    """Names of the channels of some families."""
    return tuple(name for name, channel in CHANNELS.items() if channel.family in families)


IMU = _channels(SPECIFIC_FORCE, ANGULAR_RATE)

GROUPS: Mapping[str, tuple[str, ...]] = {
    "inertial": IMU,
    "wheel": _channels(WHEEL_SPEED, WHEEL_TORQUE),
    "pressure": _channels(PRESSURE),
    "articulation": _channels(ARTICULATION_ANGLE, ARTICULATION_RATE),
}
"""Channels whose sensors are of one make."""


NAMES: Mapping[str, str] = {
    "inertial": "of the accelerometers and gyroscopes",
    "wheel": "of the wheel speeds and torques",
    "pressure": "of the cylinder pressures",
    "articulation": "of the articulation angle and rate",
}


def per_group(suffix: str, unit: str, inertial: float, high: float, si: float) -> tuple[Parameter, ...]:
    """A parameter `<group>_<suffix>` for each group; the inertial sensors typically have it, the others not."""
    typical = {"inertial": inertial}
    return tuple(
        Parameter(f"{group}_{suffix}", unit, typical.get(group, 0.0), 0.0, high, meaning, si=si)
        for group, meaning in NAMES.items()
    )


def of_groups(q: Mapping[str, float], suffix: str) -> dict[str, float]:
    """The value of each channel, from the parameters `<group>_<suffix>` of the groups."""
    return {channel: q[f"{group}_{suffix}"] for group, channels in GROUPS.items() for channel in channels}


def wheels(what: str, front: float, rear: float) -> dict[str, float]:
    """A value for the front and one for the rear channels of a quantity."""
    return {f"{what}_{wheel}": front if wheel.startswith("front") else rear for wheel in WHEELS}


def added(given: SensorParameters, field: str, values: Mapping[str, float]) -> SensorParameters:
    """The sensors with `values` added to one of their parameters, by channel."""
    changed = {
        name: replace(given.of(name), **{field: getattr(given.of(name), field) + value})
        for name, value in values.items()
    }
    return replace(given, channels={**given.channels, **changed})


def scaled(given: SensorParameters, errors: Mapping[str, float]) -> SensorParameters:
    """The sensors with another error of scale, by channel."""
    changed = {
        name: replace(given.of(name), scale_error=(1.0 + given.of(name).scale_error) * (1.0 + error) - 1.0)
        for name, error in errors.items()
    }
    return replace(given, channels={**given.channels, **changed})


def coarser(given: SensorParameters, factor: float) -> SensorParameters:
    """The sensors with steps that are `factor` times larger."""
    changed = {
        name: replace(item, resolution=item.resolution * factor) for name, item in given.channels.items()
    }
    return replace(given, channels=changed)


def turned(given: SensorParameters, roll: float, pitch: float, yaw: float) -> SensorParameters:
    """The sensors with the inertial ones turned by three angles [rad], about z, then y, then x of the frame."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return replace(given, inertial_axes=(about_z @ about_y @ about_x).T @ given.inertial_axes)
