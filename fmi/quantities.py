"""Names and units of what a plant by FMI takes and gives: commands to the actuators, and the parts of the truth as single numbers."""

from collections.abc import Mapping
from typing import Final

from plant.plant import Commands
from plant.truth import Truth
from plant.unit.actuators import four
from plant.unit.signals import CHANNELS, WHEELS

COMMANDS: Final[Mapping[str, str]] = {
    **{f"wheel_torque_command_{wheel}": "N.m" for wheel in WHEELS},
    **{f"brake_torque_command_{wheel}": "N.m" for wheel in WHEELS},
    "articulation_rate_command": "rad/s",
    "lift_rate_command": "rad/s",
    "tilt_rate_command": "rad/s",
}
"""Commands in the order of `numbers_of` -> SI unit. They are what the driver demands after the ECU's limits and the power of the motors."""

_UNITS: Final[Mapping[str, str]] = {
    "time_s": "s", "position": "m", "attitude": "1", "roll": "rad", "pitch": "rad", "yaw": "rad", "velocity": "m/s",
    "angular_velocity": "rad/s", "acceleration": "m/s2", "imu_specific_force": "m/s2", "cog_specific_force": "m/s2",
    "speed": "m/s", "articulation_angle": "rad", "articulation_rate": "rad/s", "oscillation_angle": "rad",
    "oscillation_rate": "rad/s", "lift_arm_angle": "rad", "lift_arm_rate": "rad/s", "tilt_angle": "rad",
    "tilt_rate": "rad/s", "wheel_speed": "rad/s", "wheel_torque": "N.m", "known_torque": "N.m", "inclination": "rad", "normal_force": "N",
    "longitudinal_force": "N", "lateral_force": "N", "aligning_moment": "N.m", "slip": "1", "slip_angle": "rad",
    "tyre_deflection": "m", "joint_torque": "N.m", "lift_pressure": "Pa", "tilt_pressure": "Pa",
    "steering_pressure": "Pa", "yaw_moment": "N.m", "payload_mass": "kg", "load_transfer_ratio": "1",
}  # fmt: skip
_WHEEL_FIELDS: Final = frozenset(
    ("wheel_speed", "wheel_torque", "known_torque", "normal_force", "longitudinal_force", "lateral_force", "aligning_moment",
     "slip", "slip_angle", "tyre_deflection")
)  # fmt: skip


def _names(field: str, size: int) -> tuple[str, ...]:
    """Names of the numbers of one field of the truth."""
    if size == 1:
        return (field,)
    parts: tuple[str, ...] = {2: ("left", "right"), 3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}[size]
    if field in _WHEEL_FIELDS:
        parts = WHEELS
    elif field == "inclination":
        parts = ("pitch", "roll")
    return tuple(f"{field}_{part}" for part in parts)


TRUTH: Final[Mapping[str, str]] = {
    name: _UNITS[field] for field, part in Truth.fields.items() for name in _names(field, part.size)
}
"""Every number of a Truth in the order of its row -> SI unit."""

PLACES: Final[Mapping[str, int]] = {name: i for i, name in enumerate(TRUTH)} | {
    name: channel.part.at + channel.component for name, channel in CHANNELS.items()
}
"""Place in the row of a Truth, by the name of the number or of the sensor that reads it."""


def numbers_of(commands: Commands) -> list[float]:
    """The commands as numbers, in the order of COMMANDS."""
    rates = commands.articulation_rate, commands.lift_rate, commands.tilt_rate
    return [*commands.wheel_torque, *commands.brake_torque, *rates]


def commands_of(numbers: list[float]) -> Commands:
    """The commands of numbers in the order of COMMANDS. Raises ValueError for what no actuator can be commanded."""
    articulation, lift, tilt = numbers[8:]
    return Commands(
        wheel_torque=four(numbers[:4]),
        brake_torque=four(numbers[4:8]),
        articulation_rate=articulation,
        lift_rate=lift,
        tilt_rate=tilt,
    )
