"""Errors of the sensors, read from an equipment file, for the sensor bank and for effects that change them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from configuration import CheckedTable
from plant.unit.signals import CHANNELS, FAMILIES, Channel, Family

Floats = NDArray[np.float64]

OLD_NAMES: Mapping[str, str] = {
    "acceleration": "specific_force",
    **{f"acceleration_{axis}": f"specific_force_{axis}" for axis in "xyz"},
}
"""Former names of sections: accelerometers measure specific force, and were once called acceleration sensors."""


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
    levelling: float = (
        math.inf
    )  # time constant to what its accelerometers feel [s]; infinity: they have no part in it


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
    """`base` changed by a [sensors] table: one section per family or channel; a channel's own section overrides its family's."""
    channels = {name: base.of(name) for name in CHANNELS}
    for section in sorted(table.keys(), key=lambda name: OLD_NAMES.get(name, name) not in FAMILIES):
        wanted = OLD_NAMES.get(section, section)
        if wanted not in FAMILIES and wanted not in CHANNELS:
            raise table.unknown(section, [*FAMILIES, *CHANNELS])
        entry = table.table(section)
        for name, channel in CHANNELS.items():
            if wanted in (name, channel.family.name):
                channels[name] = _read_channel(entry, channel, channels[name])
        entry.finish()
    return replace(base, channels=channels)


def _read_channel(entry: CheckedTable, sensor: Channel, base: ChannelParameters) -> ChannelParameters:
    """One section: the keys it has, over `base`."""
    family: Family = sensor.family

    def quantity(name: str, current: float, low: float = -math.inf) -> float:
        key = f"{name}_{family.suffix}"
        return entry.number(key, unit=family.label, low=low, default=current / family.factor) * family.factor

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
        levelling=base.levelling
        if sensor.felt is None
        else entry.number("levelling_s", unit="s", low=0.0, default=base.levelling),
    )
    if not channel.minimum < channel.maximum:
        low = channel.minimum / family.factor
        raise entry.error(f"minimum_{family.suffix}", f"= {low:g} {family.label} is not below the maximum")
    return channel
