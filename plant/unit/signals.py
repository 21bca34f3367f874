"""The one table of what the machine and the test instrumentation measure and send, for whoever adds or reads a signal.

A row says what a signal is called, which unit it has, where in the truth it comes from and which signal of the
DBC carries it. Order of the channels, sections of the equipment file, indexes and frames all follow from the rows
(docs/walks/add-a-signal.md). Names of the DBC are known here and in `plant.unit.reception` only.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from dbc import loader_database, reference_database
from dbc.database import Database
from dbc.packing import Signals
from plant.truth import Part, Truth

MACHINE: Final = "Machine"
"""Sender of the machine's messages in the DBC."""

TEST_RIG: Final = "TestRig"
"""Sender of the test instrumentation's messages in the DBC."""

WHEELS: Final = ("front_left", "front_right", "rear_left", "rear_right")


@dataclass(frozen=True, slots=True)
class Family:
    """Sensors of one make: they share a section [sensors.NAME] of the equipment file, and the unit of its keys."""

    name: str
    si: str  # unit of readings and of the truth, as in dbc.units
    label: str  # unit of the equipment file, for people
    suffix: str  # unit of the equipment file, at the end of its keys
    factor: float = 1.0  # SI value per value in the equipment file


@dataclass(frozen=True, slots=True)
class Channel:
    """One sensor: its reading goes into `signals`."""

    name: str
    family: Family
    part: Part  # of the truth, what an ideal sensor reads
    component: int  # of that part
    signals: tuple[str, ...]  # "Message.Signal" of the DBC
    state: str = (
        ""  # "Message.Signal" of its state; a signal that several channels share has the worst of them
    )
    # part of the truth and its component to which a sensor that levels itself goes; None: it does not
    felt: tuple[Part, int] | None = None


# Places in the vector of what the machine knows of itself, beside its sensors. The driver's demand, in the order of `driver.Demand`:
TORQUE_DEMAND, BRAKE_DEMAND, ARTICULATION_RATE_DEMAND, LIFT_DEMAND, TILT_DEMAND = range(5)
SEQUENCE: Final = 5
"""Number of the sample."""
GROUND_SPEED: Final = 6
"""From the wheels, without a sign [m/s]."""
INTEGRAL: Final = 7
"""Of the driver's speed law, torque share."""
HELD_BACK: Final = 8
"""Whether limits kept the driver from driving on at the last tick, 0 or 1."""
OWN: Final = 9
"""How many there are."""


@dataclass(frozen=True, slots=True)
class Internal:
    """A value that the machine sends without a sensor."""

    name: str
    unit: str  # SI, as in dbc.units
    place: int  # in the vector of what the machine knows of itself
    signal: str  # "Message.Signal" of the DBC


@dataclass(frozen=True, slots=True)
class Reference:
    """A value that the test instrumentation reads from the truth without error."""

    name: str
    unit: str  # SI, as in dbc.units
    part: Part
    component: int
    signal: str  # "Message.Signal" of the reference DBC


@dataclass(frozen=True, slots=True)
class Computed:
    """A value that the test instrumentation computes from the truth."""

    name: str
    unit: str  # SI, as in dbc.units
    parts: tuple[tuple[Part, int], ...]  # of the truth, each with its component
    value: Callable[..., float]  # of these parts
    signal: str  # "Message.Signal" of the reference DBC


_DEGREE = math.pi / 180
ARTICULATION_ANGLE = Family("articulation_angle", "rad", "deg", "deg", _DEGREE)
ARTICULATION_RATE = Family("articulation_rate", "rad/s", "deg/s", "deg_s", _DEGREE)
WHEEL_SPEED = Family("wheel_speed", "rad/s", "rad/s", "rad_s")
WHEEL_TORQUE = Family("wheel_torque", "N.m", "N m", "n_m")
SPECIFIC_FORCE = Family("specific_force", "m/s2", "m/s2", "m_s2")
ANGULAR_RATE = Family("angular_rate", "rad/s", "deg/s", "deg_s", _DEGREE)
SLOPE_ANGLE = Family("slope_angle", "rad", "deg", "deg", _DEGREE)
PRESSURE = Family("pressure", "Pa", "kPa", "kpa", 1e3)
LINKAGE_ANGLE = Family("linkage_angle", "rad", "deg", "deg", _DEGREE)

# Sensors of the machine, in the order in which they draw their noise: a new row in between changes the noise of those after it.
# fmt: off
SENSORS: Final = (
    Channel("articulation_angle", ARTICULATION_ANGLE, Truth.articulation_angle, 0, ("Articulation.ArticulationAngle",), "Articulation.State"),
    Channel("articulation_rate", ARTICULATION_RATE, Truth.articulation_rate, 0, ("Articulation.ArticulationRate",), "Articulation.State"),
    Channel("wheel_speed_front_left", WHEEL_SPEED, Truth.wheel_speed, 0, ("WheelSpeedsFront.Left",), "WheelSpeedsFront.LeftState"),
    Channel("wheel_speed_front_right", WHEEL_SPEED, Truth.wheel_speed, 1, ("WheelSpeedsFront.Right",), "WheelSpeedsFront.RightState"),
    Channel("wheel_speed_rear_left", WHEEL_SPEED, Truth.wheel_speed, 2, ("WheelSpeedsRear.Left",), "WheelSpeedsRear.LeftState"),
    Channel("wheel_speed_rear_right", WHEEL_SPEED, Truth.wheel_speed, 3, ("WheelSpeedsRear.Right",), "WheelSpeedsRear.RightState"),
    Channel("wheel_torque_front_left", WHEEL_TORQUE, Truth.known_torque, 0, ("WheelTorquesFront.Left",), "WheelTorquesFront.LeftState"),
    Channel("wheel_torque_front_right", WHEEL_TORQUE, Truth.known_torque, 1, ("WheelTorquesFront.Right",), "WheelTorquesFront.RightState"),
    Channel("wheel_torque_rear_left", WHEEL_TORQUE, Truth.known_torque, 2, ("WheelTorquesRear.Left",), "WheelTorquesRear.LeftState"),
    Channel("wheel_torque_rear_right", WHEEL_TORQUE, Truth.known_torque, 3, ("WheelTorquesRear.Right",), "WheelTorquesRear.RightState"),
    Channel("specific_force_x", SPECIFIC_FORCE, Truth.imu_specific_force, 0, ("BodyAcceleration.Longitudinal",), "BodyAcceleration.State"),
    Channel("specific_force_y", SPECIFIC_FORCE, Truth.imu_specific_force, 1, ("BodyAcceleration.Lateral",), "BodyAcceleration.State"),
    Channel("specific_force_z", SPECIFIC_FORCE, Truth.imu_specific_force, 2, ("BodyAcceleration.Vertical",), "BodyAcceleration.State"),
    Channel("roll_rate", ANGULAR_RATE, Truth.angular_velocity, 0, ("BodyRates.RollRate",), "BodyRates.State"),
    Channel("pitch_rate", ANGULAR_RATE, Truth.angular_velocity, 1, ("BodyRates.PitchRate", "SlopeSensor.PitchRate"), "BodyRates.State"),
    Channel("yaw_rate", ANGULAR_RATE, Truth.angular_velocity, 2, ("BodyRates.YawRate",), "BodyRates.State"),
    Channel("pitch_angle", SLOPE_ANGLE, Truth.pitch, 0, ("SlopeSensor.PitchAngle",), felt=(Truth.inclination, 0)),
    Channel("roll_angle", SLOPE_ANGLE, Truth.roll, 0, ("SlopeSensor.RollAngle",), felt=(Truth.inclination, 1)),
    Channel("lift_pressure", PRESSURE, Truth.lift_pressure, 0, ("LiftPressure.LiftCylinderPressure",)),
    Channel("tilt_pressure", PRESSURE, Truth.tilt_pressure, 0, ("TiltPressure.TiltCylinderPressure",)),
    Channel("steering_pressure_left", PRESSURE, Truth.steering_pressure, 0, ("SteeringPressures.LeftLine",), "SteeringPressures.LeftLineState"),
    Channel("steering_pressure_right", PRESSURE, Truth.steering_pressure, 1, ("SteeringPressures.RightLine",), "SteeringPressures.RightLineState"),
    Channel("lift_arm_angle", LINKAGE_ANGLE, Truth.lift_arm_angle, 0, ("LinkageAngles.LiftArmAngle",), "LinkageAngles.State"),
    Channel("tilt_angle", LINKAGE_ANGLE, Truth.tilt_angle, 0, ("LinkageAngles.TiltAngle",), "LinkageAngles.State"),
)

INTERNALS: Final = (
    Internal("sample sequence", "1", SEQUENCE, "Articulation.SampleSequence"),
    Internal("torque demand", "1", TORQUE_DEMAND, "DriverDemand.TorqueDemand"),
    Internal("brake demand", "1", BRAKE_DEMAND, "DriverDemand.BrakeDemand"),
    Internal("articulation rate demand", "rad/s", ARTICULATION_RATE_DEMAND, "DriverDemand.ArticulationRateDemand"),
    Internal("lift demand", "1", LIFT_DEMAND, "DriverDemand.LiftDemand"),
    Internal("tilt demand", "1", TILT_DEMAND, "DriverDemand.TiltDemand"),
    Internal("ground speed", "m/s", GROUND_SPEED, "VehicleSpeed.WheelBasedVehicleSpeed"),
)

REFERENCES: Final = (
    Reference("longitudinal_force_front_left", "N", Truth.longitudinal_force, 0, "WheelForceFrontLeft.Longitudinal"),
    Reference("longitudinal_force_front_right", "N", Truth.longitudinal_force, 1, "WheelForceFrontRight.Longitudinal"),
    Reference("longitudinal_force_rear_left", "N", Truth.longitudinal_force, 2, "WheelForceRearLeft.Longitudinal"),
    Reference("longitudinal_force_rear_right", "N", Truth.longitudinal_force, 3, "WheelForceRearRight.Longitudinal"),
    Reference("lateral_force_front_left", "N", Truth.lateral_force, 0, "WheelForceFrontLeft.Lateral"),
    Reference("lateral_force_front_right", "N", Truth.lateral_force, 1, "WheelForceFrontRight.Lateral"),
    Reference("lateral_force_rear_left", "N", Truth.lateral_force, 2, "WheelForceRearLeft.Lateral"),
    Reference("lateral_force_rear_right", "N", Truth.lateral_force, 3, "WheelForceRearRight.Lateral"),
    Reference("normal_force_front_left", "N", Truth.normal_force, 0, "WheelForceFrontLeft.Normal"),
    Reference("normal_force_front_right", "N", Truth.normal_force, 1, "WheelForceFrontRight.Normal"),
    Reference("normal_force_rear_left", "N", Truth.normal_force, 2, "WheelForceRearLeft.Normal"),
    Reference("normal_force_rear_right", "N", Truth.normal_force, 3, "WheelForceRearRight.Normal"),
    Reference("aligning_moment_front_left", "N.m", Truth.aligning_moment, 0, "WheelForceFrontLeft.AligningMoment"),
    Reference("aligning_moment_front_right", "N.m", Truth.aligning_moment, 1, "WheelForceFrontRight.AligningMoment"),
    Reference("aligning_moment_rear_left", "N.m", Truth.aligning_moment, 2, "WheelForceRearLeft.AligningMoment"),
    Reference("aligning_moment_rear_right", "N.m", Truth.aligning_moment, 3, "WheelForceRearRight.AligningMoment"),
    Reference("velocity_x", "m/s", Truth.velocity, 0, "BodyVelocity.Longitudinal"),
    Reference("velocity_y", "m/s", Truth.velocity, 1, "BodyVelocity.Lateral"),
    Reference("velocity_z", "m/s", Truth.velocity, 2, "BodyVelocity.Vertical"),
    Reference("acceleration_x", "m/s2", Truth.acceleration, 0, "BodyAccelerationReference.Longitudinal"),
    Reference("acceleration_y", "m/s2", Truth.acceleration, 1, "BodyAccelerationReference.Lateral"),
    Reference("acceleration_z", "m/s2", Truth.acceleration, 2, "BodyAccelerationReference.Vertical"),
    Reference("roll", "rad", Truth.roll, 0, "BodyAttitude.Roll"),
    Reference("pitch", "rad", Truth.pitch, 0, "BodyAttitude.Pitch"),
    Reference("joint_torque", "N.m", Truth.joint_torque, 0, "JointLoad.JointTorque"),
    Reference("oscillation_angle", "rad", Truth.oscillation_angle, 0, "JointLoad.OscillationAngle"),
)

COMPUTED: Final = (
    Computed("yaw", "rad", ((Truth.yaw, 0),), lambda yaw: math.remainder(yaw, math.tau), "BodyAttitude.Yaw"),
    Computed("ground_speed", "m/s", ((Truth.velocity, 0), (Truth.velocity, 1)), math.hypot, "SatelliteSpeed.GroundSpeed"),
    Computed("course", "rad", ((Truth.yaw, 0), (Truth.velocity, 0), (Truth.velocity, 1)), lambda *parts: _course(*parts), "SatelliteSpeed.Course"),
)
# fmt: on


def _course(yaw: float, forward: float, left: float) -> float:
    """Direction of the joint's velocity over ground, 0 to one turn [rad]."""
    return (yaw + math.atan2(left, forward)) % math.tau


CHANNELS: Final[Mapping[str, Channel]] = {channel.name: channel for channel in SENSORS}
FAMILIES: Final[Mapping[str, Family]] = {channel.family.name: channel.family for channel in SENSORS}
INDEX: Final[Mapping[str, int]] = {name: i for i, name in enumerate(CHANNELS)}
"""Place of each channel in a vector of readings."""


def family_slice(family: Family) -> slice:
    """Places of the channels of a family in a vector of readings; their rows stand together."""
    places = [i for i, channel in enumerate(SENSORS) if channel.family is family]
    return slice(places[0], places[-1] + 1)


def _states() -> dict[str, tuple[str, ...]]:
    """State signals of the DBC, each with its channels."""
    found: dict[str, tuple[str, ...]] = {}
    for channel in SENSORS:
        if channel.state:
            found[channel.state] = (*found.get(channel.state, ()), channel.name)
    return found


STATES: Final[Mapping[str, tuple[str, ...]]] = _states()
"""State signal ("Message.Signal", also the name of its value) -> channels whose worst state it has."""


def _messages(database: Database, carried: Iterable[tuple[str, str, str]]) -> dict[str, Signals]:
    """Messages with unit and source of each signal, from (place, unit, source); both in the order of the DBC."""
    found: dict[str, dict[str, tuple[str, str]]] = {}
    for place, unit, source in carried:
        message, _, signal = place.partition(".")
        found.setdefault(message, {})[signal] = (unit, source)
    order = [name for name in database.by_name if name in found]
    order += [name for name in found if name not in database.by_name]  # the schedule refuses them by name
    return {name: _in_order(database, name, found[name]) for name in order}


def _in_order(database: Database, message: str, signals: dict[str, tuple[str, str]]) -> Signals:
    """The signals in the order of the DBC; those it does not know come last, and the binding refuses them by name."""
    known = database.by_name[message].signals if message in database.by_name else ()
    order = [name for name in known if name in signals]
    return {name: signals[name] for name in (*order, *(set(signals) - set(order)))}


MACHINE_MESSAGES: Final[Mapping[str, Signals]] = _messages(
    loader_database(),
    (
        *((place, row.family.si, row.name) for row in SENSORS for place in row.signals),
        *((state, "1", state) for state in STATES),
        *((row.signal, row.unit, row.name) for row in INTERNALS),
    ),
)
REFERENCE_MESSAGES: Final[Mapping[str, Signals]] = _messages(
    reference_database(), ((row.signal, row.unit, row.name) for row in (*REFERENCES, *COMPUTED))
)
