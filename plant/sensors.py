"""Sensors between the truth and the frames: scale, bias, lag, delay, noise, saturation, resolution, dropout.

Each channel is sampled once per tick (the bank's step), in this order:

    measured = truth (1 + scale error) + bias
    lagged   = first-order low-pass, exact for an input held over the step
    delayed  = lagged one delay ago, linear between samples (exact for whole steps)
    noisy    = delayed + Gaussian noise, white at the sample rate
    reading  = noisy, limited to the sensor's range, rounded to its resolution

A dropped sample repeats the last reading. A parameter of zero switches its term off exactly:
a bank of ideal sensors returns its input bit for bit. Random numbers come from a generator passed
in, two per channel and step whatever the parameters, so that changing one channel leaves
the noise of the others as it was.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from plant.checked import CheckedTable
from plant.compiled import compiled
from plant.truth import Part, Truth

Floats = NDArray[np.float64]

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


class Health(IntEnum):
    """State of a channel's reading, numbered as the DBC's State tables."""

    OK = 0
    DEGRADED = 1  # at the end of its range
    ERROR = 2  # no sample: the last reading is repeated


OK, DEGRADED, ERROR = (int(health) for health in Health)  # for compiled code


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of a family of channels: suffix of its TOML keys, and its size in SI."""

    suffix: str
    label: str
    si: float


_DEGREE = Unit("deg", "deg", math.pi / 180)
_DEGREE_PER_SECOND = Unit("deg_s", "deg/s", math.pi / 180)
_RADIAN_PER_SECOND = Unit("rad_s", "rad/s", 1.0)
_TORQUE = Unit("n_m", "N m", 1.0)
_ACCELERATION = Unit("m_s2", "m/s2", 1.0)
_PRESSURE = Unit("kpa", "kPa", 1e3)

FAMILIES: Mapping[str, Unit] = {
    "articulation_angle": _DEGREE,
    "articulation_rate": _DEGREE_PER_SECOND,
    "wheel_speed": _RADIAN_PER_SECOND,
    "wheel_torque": _TORQUE,
    "acceleration": _ACCELERATION,
    "angular_rate": _DEGREE_PER_SECOND,
    "slope_angle": _DEGREE,
    "pressure": _PRESSURE,
    "linkage_angle": _DEGREE,
}

CHANNELS: Mapping[str, str] = {
    "articulation_angle": "articulation_angle",
    "articulation_rate": "articulation_rate",
    **{f"wheel_speed_{wheel}": "wheel_speed" for wheel in WHEELS},
    **{f"wheel_torque_{wheel}": "wheel_torque" for wheel in WHEELS},
    **{f"acceleration_{axis}": "acceleration" for axis in "xyz"},
    "roll_rate": "angular_rate",
    "pitch_rate": "angular_rate",
    "yaw_rate": "angular_rate",
    "pitch_angle": "slope_angle",
    "roll_angle": "slope_angle",
    "lift_pressure": "pressure",
    "tilt_pressure": "pressure",
    "steering_pressure_left": "pressure",
    "steering_pressure_right": "pressure",
    "lift_arm_angle": "linkage_angle",
    "tilt_angle": "linkage_angle",
}
"""Channel name -> family, in the order of every vector of this module."""

INDEX: Mapping[str, int] = {name: i for i, name in enumerate(CHANNELS)}
WHEEL_SPEED = slice(INDEX["wheel_speed_front_left"], INDEX["wheel_speed_rear_right"] + 1)
ACCELERATION = slice(INDEX["acceleration_x"], INDEX["acceleration_z"] + 1)
ANGULAR_RATE = slice(INDEX["roll_rate"], INDEX["yaw_rate"] + 1)


def _places() -> Iterator[int]:
    """Where in a row of truth each channel finds what an ideal sensor would read, in the order of CHANNELS."""
    parts: tuple[Part, ...] = (
        Truth.articulation_angle,
        Truth.articulation_rate,
        Truth.wheel_speed,
        Truth.wheel_torque,
        Truth.imu_specific_force,
        Truth.angular_velocity,
        Truth.pitch,
        Truth.roll,
        Truth.lift_pressure,
        Truth.tilt_pressure,
        Truth.steering_pressure,
        Truth.lift_arm_angle,
        Truth.tilt_angle,
    )
    for part in parts:
        yield from range(part.at, part.at + part.size)


MEASURED = np.fromiter(_places(), np.int64, len(CHANNELS))


def measured_values(truth: Truth) -> Floats:
    """What ideal sensors would read, SI, in the order of CHANNELS."""
    return truth.row[MEASURED]


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelParameters:
    """One sensor in SI units of its quantity; the default is an ideal sensor."""

    bias: float = 0.0
    scale_error: float = 0.0  # reading per truth, minus one
    lag: float = 0.0  # time constant [s]
    delay: float = 0.0  # [s]
    noise: float = 0.0  # standard deviation
    minimum: float = -math.inf
    maximum: float = math.inf
    resolution: float = 0.0
    dropout: float = 0.0  # probability that a sample is missing


@dataclass(frozen=True, slots=True)
class SensorParameters:
    """Parameters of all channels; those not named are ideal.

    inertial_axes: (3, 3) from the frame's axes to those of the inertial sensor.
    """

    channels: Mapping[str, ChannelParameters] = field(default_factory=dict)
    inertial_axes: Floats = field(default_factory=lambda: np.eye(3), compare=False)

    def of(self, channel: str) -> ChannelParameters:
        """Parameters of one channel."""
        return self.channels.get(channel, ChannelParameters())


def read_sensors(table: CheckedTable, base: SensorParameters) -> SensorParameters:
    """`base` with what a [sensors] table says: a section per family or channel, the channel's word last."""
    channels = {name: base.of(name) for name in CHANNELS}
    for section in sorted(table.keys(), key=lambda name: name not in FAMILIES):
        unit = FAMILIES.get(section) or FAMILIES.get(CHANNELS.get(section, ""))
        if unit is None:
            raise table.unknown(section, [*FAMILIES, *CHANNELS])
        entry = table.table(section)
        for name, family in CHANNELS.items():
            if section in (name, family):
                channels[name] = _read_channel(entry, unit, channels[name])
        entry.finish()
    return replace(base, channels=channels)


def _read_channel(entry: CheckedTable, unit: Unit, base: ChannelParameters) -> ChannelParameters:
    """One section: the keys it has, over `base`."""

    def quantity(name: str, current: float, low: float = -math.inf) -> float:
        key = f"{name}_{unit.suffix}"
        return entry.number(key, unit=unit.label, low=low, default=current / unit.si) * unit.si

    def percent(key: str, current: float, low: float) -> float:
        return entry.number(key, unit="%", low=low, high=100.0, default=current * 100) / 100

    def milliseconds(key: str, current: float) -> float:
        return entry.number(key, unit="ms", low=0.0, high=1000.0, default=current * 1e3) / 1e3

    entry.text("confidence", default="-")
    entry.text("source", default="-")
    channel = ChannelParameters(
        bias=quantity("bias", base.bias),
        noise=quantity("noise", base.noise, 0.0),
        resolution=quantity("resolution", base.resolution, 0.0),
        minimum=quantity("minimum", base.minimum),
        maximum=quantity("maximum", base.maximum),
        scale_error=percent("scale_error_percent", base.scale_error, -100.0),
        dropout=percent("dropout_percent", base.dropout, 0.0),
        lag=milliseconds("lag_ms", base.lag),
        delay=milliseconds("delay_ms", base.delay),
    )
    if not channel.minimum < channel.maximum:
        low = channel.minimum / unit.si
        raise entry.error(f"minimum_{unit.suffix}", f"= {low:g} {unit.label} is not below the maximum")
    return channel


@dataclass(frozen=True, slots=True)
class Readings:
    """One sample of every channel, in the order of CHANNELS."""

    values: Floats  # SI
    health: NDArray[np.int64]  # Health

    def value(self, channel: str) -> float:
        """The reading of one channel, SI."""
        return float(self.values[INDEX[channel]])


# Rows of the parameters of all channels.
GAIN, BIAS, DECAY, NOISE, MINIMUM, MAXIMUM, RESOLUTION, DROPOUT, DELAY = range(9)


class SensorBank:
    """All sensors of a machine, sampled together every `step` seconds."""

    def __init__(self, parameters: SensorParameters, *, step: float, generator: np.random.Generator) -> None:
        channels = [parameters.of(name) for name in CHANNELS]

        def column(name: str) -> Floats:
            return np.array([getattr(channel, name) for channel in channels], dtype=np.float64)

        lag, delay = column("lag"), np.round(column("delay") / step, 9)  # in steps; 0.03 / 0.01 is 3
        self._generator = generator
        self._axes = None if (parameters.inertial_axes == np.eye(3)).all() else parameters.inertial_axes
        self._parameters = np.array(
            (
                1.0 + column("scale_error"),
                column("bias"),
                np.exp(-step / np.where(lag > 0, lag, 1.0)) * (lag > 0),
                column("noise"),
                column("minimum"),
                column("maximum"),
                column("resolution"),
                column("dropout"),
                delay,
            )
        )
        self._history: Floats = np.empty((int(delay.max()) + 2, len(channels)))
        self._newest = -1  # row of the newest sample; -1: none yet
        self._last: Floats = np.empty(len(channels))
        self._normal, self._uniform = np.empty(len(channels)), np.empty(len(channels))

    def sample(self, truth: Floats | list[float]) -> Readings:
        """The readings one step later, for the true values `truth` held since the last call.

        The first call finds every sensor settled at its input.
        """
        true = np.asarray(truth, dtype=np.float64)
        if self._axes is not None:
            true = true.copy()
            for part in (ACCELERATION, ANGULAR_RATE):
                true[part] = self._axes @ true[part]
        if self._newest < 0:
            self._last = true * self._parameters[GAIN] + self._parameters[BIAS]
            self._history[:] = self._last
        self._newest = (self._newest + 1) % len(self._history)
        self._generator.standard_normal(out=self._normal)
        self._generator.random(out=self._uniform)
        values, health = np.empty(len(CHANNELS)), np.empty(len(CHANNELS), np.int64)
        read_channels(
            true,
            self._parameters,
            self._history,
            self._newest,
            self._normal,
            self._uniform,
            self._last,
            values,
            health,
        )
        self._last = values
        return Readings(values, health)


@compiled
def read_channels(
    true: Floats,
    p: Floats,
    history: Floats,
    newest: int,
    normal: Floats,
    uniform: Floats,
    last: Floats,
    values: Floats,
    health: NDArray[np.int64],
) -> None:
    """One sample of every channel into `values` and `health`; `history[newest]` becomes what the sensors feel now."""
    for i in range(values.size):
        measured = true[i] * p[GAIN, i] + p[BIAS, i]
        history[newest, i] = measured + p[DECAY, i] * (history[newest - 1, i] - measured)
        noisy = delayed(history, newest, i, p[DELAY, i]) + p[NOISE, i] * normal[i]
        limited = min(max(noisy, p[MINIMUM, i]), p[MAXIMUM, i])
        step = p[RESOLUTION, i]
        values[i] = np.rint(limited / step) * step if step > 0.0 else limited
        health[i] = OK if limited == noisy else DEGRADED
        if uniform[i] < p[DROPOUT, i]:
            values[i], health[i] = last[i], ERROR


@compiled
def delayed(history: Floats, newest: int, channel: int, steps: float) -> float:
    """What a channel felt `steps` samples ago, linear between samples."""
    whole = int(steps)
    near = (newest - whole) % len(history)
    if steps == 0.0:
        return history[near, channel]
    part = steps - whole
    return (1.0 - part) * history[near, channel] + part * history[near - 1, channel]
