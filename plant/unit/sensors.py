"""Sensors between the truth and the frames: scale, bias, lag, delay, noise, saturation, resolution, dropout.

Each channel is sampled once per tick (the bank's step), in this order:

    levelled = truth + first-order low-pass of (what accelerometers take for it - truth)
    measured = levelled (1 + scale error) + bias
    lagged   = first-order low-pass, exact for an input held over the step
    delayed  = lagged one delay ago, linear between samples (exact for whole steps)
    noisy    = delayed + Gaussian noise, white at the sample rate
    reading  = noisy, limited to the sensor's range, rounded to its resolution

Levelling is that of an inclination sensor: its gyro follows the truth at once, its accelerometers correct the gyro in the long run,
and feel every acceleration as a slope. A time constant of zero is an inclination sensor without a gyro.
A dropped sample repeats the last reading. A parameter of zero switches its term off exactly:
a bank of ideal sensors returns its input bit for bit. Random numbers come from a generator passed
in, two per channel and step whatever the parameters, so that changing one channel leaves
the noise of the others as it was.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bus.machine_code import direct
from plant.compiled import uncounted
from plant.effects.effect import ActiveEffect
from plant.effects.registry import python_hook
from plant.truth import Truth
from plant.unit.sensor_parameters import SensorParameters
from plant.unit.signals import (
    ANGULAR_RATE,
    CHANNELS,
    INDEX,
    SENSORS,
    SPECIFIC_FORCE,
    family_slice,
)

Floats = NDArray[np.float64]


class Health(IntEnum):
    """State of a channel's reading, numbered as the DBC's State tables."""

    OK = 0
    DEGRADED = 1  # at the end of its range
    ERROR = 2  # no sample: the last reading is repeated


OK, DEGRADED, ERROR = (int(health) for health in Health)  # for compiled code


ACCELEROMETERS, GYROSCOPES = family_slice(SPECIFIC_FORCE), family_slice(ANGULAR_RATE)
_MEASURED = np.array([channel.part.at + channel.component for channel in SENSORS])
_LEVELLED = np.array([i for i, channel in enumerate(SENSORS) if channel.felt is not None])
_FELT = np.array([channel.felt[0].at + channel.felt[1] for channel in SENSORS if channel.felt is not None])


def measured_values(truth: Truth) -> Floats:
    """What ideal sensors would read, SI, in the order of CHANNELS."""
    return truth.row[_MEASURED]


def felt_values(truth: Truth) -> Floats:
    """What the accelerometers of the sensors that level themselves take for their quantity, SI, in the order of CHANNELS."""
    return truth.row[_FELT]


class Readings(NamedTuple):
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

        # rounded, because 0.03 / 0.01 is 2.9999999999999996 and would interpolate between two samples
        lag, delay = column("lag"), np.round(column("delay") / step, 9)  # in steps
        self._generator = generator
        self._axes = None if (parameters.inertial_axes == np.eye(3)).all() else parameters.inertial_axes
        self._parameters = np.array(
            (
                1.0 + column("scale_error"),
                column("bias"),
                # no lag: exactly 0, without dividing by it
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
        levelling = column("levelling")[_LEVELLED]
        self._levels = bool(np.isfinite(levelling).any())
        # infinity: the share that stays is exactly 1, so that the lean stays 0
        self._leaning = np.exp(-step / np.maximum(levelling, step / 700)) * (levelling > 0)
        self._lean: Floats = np.zeros(_LEVELLED.size)  # by which accelerations have led a sensor astray
        self._normal, self._uniform = np.empty(len(channels)), np.empty(len(channels))
        row, health = np.empty(len(channels)), np.empty(len(channels), np.int64)
        draws = self._normal, self._uniform
        self._read = direct(read_channels, row, self._parameters, self._history, 0, *draws, row, row, health)
        self._level = direct(level_channels, row, self._lean, _LEVELLED, self._leaning, True, self._lean)

    def sample(self, truth: Floats | list[float], felt: Floats | None = None) -> Readings:
        """The readings one step later, for the true values `truth` held since the last call.

        felt: from `felt_values`; without, sensors that level themselves feel no acceleration.
        At the first call every sensor is in steady state at its input.
        """
        true = np.asarray(truth, dtype=np.float64)
        if self._levels and felt is not None:
            true = self._levelled(true, felt)
        if self._axes is not None:
            true = true.copy()
            for part in (ACCELEROMETERS, GYROSCOPES):
                true[part] = self._axes @ true[part]
        if self._newest < 0:
            self._last = true * self._parameters[GAIN] + self._parameters[BIAS]
            self._history[:] = self._last
        self._newest = (self._newest + 1) % len(self._history)
        self._generator.standard_normal(out=self._normal)
        self._generator.random(out=self._uniform)
        values, health = np.empty(len(CHANNELS)), np.empty(len(CHANNELS), np.int64)
        self._read(
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

    def _levelled(self, true: Floats, felt: Floats) -> Floats:
        """The true values as gyro and accelerometers of a levelled sensor give them together."""
        true = true.copy()
        self._level(true, felt, _LEVELLED, self._leaning, self._newest < 0, self._lean)
        return true


@uncounted
def level_channels(
    true: Floats, felt: Floats, places: NDArray[np.int64], leaning: Floats, first: bool, lean: Floats
) -> None:
    """Add to the true values at `places` by how much accelerations lead their sensors astray; `lean` is carried from step to step.

    leaning: share of a lean that stays for a step, 1 for a sensor that never follows its accelerometers; first: every
    other one has long followed them.
    """
    for k in range(places.size):
        kept = 0.0 if first and leaning[k] != 1.0 else leaning[k]
        lean[k] = (1.0 - kept) * (felt[k] - true[places[k]]) + kept * lean[k]
        true[places[k]] += lean[k]


@uncounted
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
        # newest = 0: index -1 is the last row of the ring, which is the sample before
        history[newest, i] = measured + p[DECAY, i] * (history[newest - 1, i] - measured)
        noisy = delayed(history, newest, i, p[DELAY, i]) + p[NOISE, i] * normal[i]
        limited = min(max(noisy, p[MINIMUM, i]), p[MAXIMUM, i])
        step = p[RESOLUTION, i]
        values[i] = np.rint(limited / step) * step if step > 0.0 else limited
        health[i] = OK if limited == noisy else DEGRADED
        if uniform[i] < p[DROPOUT, i]:
            values[i], health[i] = last[i], ERROR


@uncounted
def delayed(history: Floats, newest: int, channel: int, steps: float) -> float:
    """What a channel felt `steps` samples ago, linear between samples."""
    whole = int(steps)
    near = (newest - whole) % len(history)
    if steps == 0.0:
        return history[
            near, channel
        ]  # 1 x value + 0 x older would lose the bit-for-bit identity when older is not finite
    part = steps - whole
    return (1.0 - part) * history[near, channel] + part * history[near - 1, channel]


def faulty(given: SensorParameters, chosen: Sequence[ActiveEffect]) -> SensorParameters:
    """The sensors' parameters as the chosen effects change them."""
    for item in chosen:
        change = python_hook(item.effect, "sensors")
        if change is not None:
            given = change(item.named, given)
    return given
