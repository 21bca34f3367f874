"""Channels of the loader's model: measured inputs, optional inputs and predicted outputs, with their units."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from plant.unit.signals import WHEELS

TORQUES = tuple(f"wheel_torque_{wheel}" for wheel in WHEELS)
SPEEDS = tuple(f"wheel_speed_{wheel}" for wheel in WHEELS)
INPUTS: Mapping[str, str] = {
    **dict.fromkeys(TORQUES, "N.m"),
    "articulation_angle": "rad",
    "articulation_rate": "rad/s",
    "lift_arm_angle": "rad",
    "tilt_angle": "rad",
}
# the driver's demands: without noise, so that they carry the fast part of the inputs (replay_inputs)
OPTIONAL: Mapping[str, str] = {
    "torque_demand": "1",
    "brake_demand": "1",
    "articulation_rate_demand": "rad/s",
    "lift_demand": "1",
    "tilt_demand": "1",
}
LIMITS: Mapping[str, str] = dict.fromkeys(
    (
        "articulation_rate_limit",
        "lift_up_limit",
        "lift_down_limit",
        "tilt_back_limit",
        "tilt_forward_limit",
    ),
    "rad/s",
)
"""Largest rates that the machine obeys, as positive numbers: an ECU that keeps it on its wheels takes them off what the driver demands."""


@dataclass(frozen=True, slots=True)
class Channel:
    """An output of the model: a channel of the machine's sensors or of the test instruments."""

    unit: str
    typical: float  # error that matters to an engineer [unit]
    zero: float  # standard deviation of the sensor's zero point [unit]; 0: exact
    columns: tuple[str, int | None]  # quantity of plant.truth, and its index where that is a vector
    faults: tuple[str, ...] = ()  # kinds of sensor faults that are searched for
    scale: float = 0.0  # standard deviation of the sensor's scale [1]; 0: exact
    # quantity of plant.truth that the accelerometers of a levelled sensor take for its own, and its index
    felt: tuple[str, int] | None = None


TORQUE_SCALE_SD: Final = (
    0.02  # of a wheel torque's scale error: motor controllers and brake pressure only estimate it [1]
)
RATE_ZERO_SD: Final = 0.006  # of a rate sensor's zero error [rad/s]
PRESSURE_SCALE_SD: Final = 2.5e-3  # accuracy class of the pressure transducers in the equipment's sheet [1]


def _machine_channels() -> dict[str, Channel]:
    faults = ("bias", "scale", "delay", "lag")
    return {
        # no bias and no lag: a counter of teeth has neither
        **{
            name: Channel("rad/s", 0.05, 0.0, ("wheel_speed", i), ("scale", "delay"))
            for i, name in enumerate(SPEEDS)
        },
        **{
            f"specific_force_{axis}": Channel("m/s^2", 0.1, 0.1, ("imu_specific_force", i), faults)
            for i, axis in enumerate("xyz")
        },
        **{
            f"{axis}_rate": Channel("rad/s", 0.01, RATE_ZERO_SD, ("angular_velocity", i), faults)
            for i, axis in enumerate(("roll", "pitch", "yaw"))
        },
        "pitch_angle": Channel(
            "rad", 0.005, 0.005, ("pitch", None), ("bias", "delay", "lag"), felt=("inclination", 0)
        ),
        "roll_angle": Channel(
            "rad", 0.005, 0.005, ("roll", None), ("bias", "delay", "lag"), felt=("inclination", 1)
        ),
        "lift_pressure": Channel(
            "Pa", 2e5, 1e5, ("lift_pressure", None), ("bias", "scale", "delay", "lag"), PRESSURE_SCALE_SD
        ),
        "tilt_pressure": Channel(
            "Pa", 2e5, 1e5, ("tilt_pressure", None), ("bias", "scale"), PRESSURE_SCALE_SD
        ),
        **{
            f"steering_pressure_{side}": Channel(
                "Pa", 2e5, 1e5, ("steering_pressure", i), ("bias", "scale"), PRESSURE_SCALE_SD
            )
            for i, side in enumerate(("left", "right"))
        },
    }


def _reference_channels() -> dict[str, Channel]:
    wheels = {
        f"{quantity}_{wheel}": Channel("N", 500.0, 0.0, (quantity, i))
        for quantity in ("normal_force", "longitudinal_force", "lateral_force")
        for i, wheel in enumerate(WHEELS)
    }
    return {
        **wheels,
        "joint_torque": Channel("N.m", 500.0, 0.0, ("joint_torque", None)),
        "oscillation_angle": Channel("rad", 0.005, 0.0, ("oscillation_angle", None)),
    }


REFERENCE: Final = frozenset(_reference_channels())
"""Channels of the test instruments, which a machine in use does not have."""
CHANNELS: Mapping[str, Channel] = {**_machine_channels(), **_reference_channels()}


def felt(name: str) -> str:
    """Name of what the accelerometers of a levelled sensor take for its quantity."""
    return f"{name} felt"


LEVELLED: Final = {name: channel.felt for name, channel in CHANNELS.items() if channel.felt is not None}
"""Channels of levelled sensors: what their accelerometers feel."""
