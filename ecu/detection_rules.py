"""What a calibration says for the detection: false alarms, what is uncertain of the machine, and its sensors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from configuration import CheckedTable
from ecu.quantity import Quantity, read_section


class Tolerances(NamedTuple):
    """What is uncertain of the machine, and where its equations end."""

    radius: float  # of a wheel, share
    stiffness: float  # of the tyres' slip, share
    mass: float  # share
    centre: float  # of gravity [m]
    rolling: float  # rolling resistance, share of the load
    torque: float  # scale of a torque signal, share
    power: float  # from which on the wheels' torques follow their speeds [W]
    back_pressure: float  # of the steering line that does not push [Pa]
    digging: float  # force of a pile that is no fault of a torque [N]
    gain: float  # of rates and angles, share
    time: float  # between samples of two sensors: cycles of messages, lags [s]


@dataclass(frozen=True, slots=True)
class Sensor:
    """One make of sensor, SI."""

    noise: float  # standard deviation
    offset: float  # that a sound one may have
    # innovation beside noise when the machine sets in, in proportion to those of the other sensors
    onset: float
    resolution: float


@dataclass(frozen=True, slots=True)
class DetectionRules:
    """The calibration's [detection]: false alarms per hour, tolerances of the machine, sensors by family."""

    false_alarms: float
    tolerances: Tolerances
    sensors: Mapping[str, Sensor]


_RULES: Final = {
    "false_alarms": Quantity("false_alarms_per_h", 1e-9, 1.0),
    "radius": Quantity("radius", 0.0, 0.2),
    "stiffness": Quantity("stiffness", 0.0, 1.0),
    "mass": Quantity("mass", 0.0, 0.5),
    "centre": Quantity("centre_m", 0.0, 0.5),
    "rolling": Quantity("rolling", 0.0, 0.3),
    "torque": Quantity("torque", 0.0, 0.5),
    "power": Quantity("power_kn_m_s", 1.0, 1000.0),
    "back_pressure": Quantity("back_pressure_kpa", 0.0, 5000.0),
    "digging": Quantity("digging_kn", 0.0, 100.0),
    "gain": Quantity("gain", 0.0, 0.1),
    "time": Quantity("time_ms", 0.0, 200.0),
}
SENSORS: Final[Mapping[str, str]] = {
    "articulation_angle": "deg",
    "articulation_rate": "deg_s",
    "wheel_speed": "rad_s",
    "wheel_torque": "kn_m",
    "specific_force": "m_s2",
    "angular_rate": "deg_s",
    "slope": "deg",
    "pressure": "kpa",
    "linkage_angle": "deg",
    "steering_pressure": "kpa",
}
"""The families of sensors, with the unit of their keys."""


def section_of(family: str) -> str:
    """The calibration's section for a family of sensors."""
    return f"sensor_{family}"


SECTIONS: Final = frozenset(("detection", *map(section_of, SENSORS)))
"""What a calibration says for the detection."""


def read_detection(top: CheckedTable) -> DetectionRules:
    """The tables [detection] and [sensor_FAMILY] of a calibration. Raises ConfigurationError."""
    found = read_section(top, "detection", _RULES)
    false_alarms = found.pop("false_alarms")
    return DetectionRules(
        false_alarms,
        Tolerances(**found),
        {
            family: Sensor(**read_section(top, section_of(family), _keys(unit)))
            for family, unit in SENSORS.items()
        },
    )


def _keys(unit: str) -> dict[str, Quantity]:
    return {
        name: Quantity(f"{name}_{unit}", 1e-6 if name == "noise" else 0.0, 1e6)
        for name in ("noise", "offset", "onset", "resolution")
    }


DETECTION_QUANTITIES: Final[Mapping[str, tuple[Quantity, ...]]] = {
    "detection": tuple(_RULES.values()),
    **{section_of(family): tuple(_keys(unit).values()) for family, unit in SENSORS.items()},
}
"""Section of a calibration -> its keys with unit and permitted range."""
