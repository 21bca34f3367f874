"""What is identified of a machine from its drives: parameters of the loader's model, beside the values of the sheet that they change.

The model's parameters are differences from the sheet, or factors. A reader wants the sheet's own quantities with their units, and a machine
file its own keys. `quantities` gives both for each parameter.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

from diagnosis.apply.machine_files import entry
from diagnosis.apply.toml_text import Line
from discrepancy.model.description import Model, Parameter
from discrepancy.models.loader.channels import LEVELLED
from discrepancy.models.loader.nuisances import BODIES
from identify.machine.weighing import G
from identify.tyre.parameters import Nominal
from identify.tyre.patch import nominal_stiffness
from plant.sheets.machine import Machine
from plant.unit.sensor_parameters import SensorParameters

PAYLOAD: Final = "payload_mass.extra_kg"
MOVED: Final = ("yaw_inertia", "roll_inertia", "payload_mass")
"""Effects of the model's library that act as parameters of an identification do."""

JOINTS: Final = {
    "articulation_zero": "articulation_angle",
    "lift_zero": "lift_arm_angle",
    "tilt_zero": "tilt_angle",
}
"""Channel of each joint's zero point."""

FELT_BY: Final = {"pitch_angle": "specific_force_x", "roll_angle": "specific_force_y"}
"""Accelerometer along the axis whose accelerations a levelled sensor takes for a slope."""

Kind = Literal["machine", "sensor"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity that a reader sees, as a rising function of one parameter of the model."""

    parameter: str  # of the model
    label: str
    unit: str
    kind: Kind
    value: Callable[[float], float]  # the quantity at a value of the parameter
    keys: tuple[tuple[str, str, Callable[[float], float]], ...] = ()  # table, key and value of a machine file


def identification_model(model: Model, *, payload_sd: float = 0.0) -> Model:
    """The model whose nuisances are all that drives may determine; payload_sd: of the payload that the runs state [kg], 0 where it is exact.

    The payload keeps the value of the baseline as the mean of its prior.
    """
    payload: list[Parameter] = []
    if payload_sd > 0.0:
        payload = [replace(model.parameter(PAYLOAD), typical=payload_sd, prior_sd=payload_sd)]
    return replace(
        model,
        nuisances=(*model.nuisances, *BODIES, *payload),
        # Derivatives of a nearby point end a fit beside its optimum: little in the search of an effect, several standard deviations here.
        jacobian_reach=0.0,
        floors={**model.floors, **_levelled_floors(model)},
        effects=tuple(
            e for e in model.effects if e.name not in MOVED or (e.name == MOVED[2] and not payload)
        ),
    )


def _levelled_floors(model: Model) -> dict[str, float]:
    """Floors of the noise of levelled slope sensors [rad]: their own, and that of the acceleration that they take for a slope.

    A levelled sensor is an accelerometer too, with far less noise than the inertial unit's. The replay's acceleration in a turn is wrong by
    about a thousandth; by the sensor's own noise that would be seen in the slope, and be taken for a smaller wheel.
    """
    own = model.floors
    return {name: math.hypot(own[name], own[FELT_BY[name]] / G) for name in LEVELLED}


def quantities(machine: Machine, model: Model) -> list[Quantity]:
    """One quantity for every shared parameter of an identification, those of the machine first."""
    m, known = machine, {p.name for p in model.nuisances if p.scope == "all"}
    rear, front = m.rear_frame, m.front_frame
    found = [
        _shifted("rear_mass", "mass of the rear frame", "kg", "rear_frame", "mass_kg", rear.mass),
        _shifted("front_mass", "mass of the front frame", "kg", "front_frame", "mass_kg", front.mass),
        _shifted("rear_x", "centre of the rear frame, forward of the joint", "m", "rear_frame", "x_m", rear.x),
        _shifted("front_x", "centre of the front frame, forward of the joint", "m", "front_frame", "x_m", front.x),
        _shifted("rear_height", "centre of the rear frame, above ground", "m", "rear_frame", "z_m", rear.z),
        _shifted("front_height", "centre of the front frame, above ground", "m", "front_frame", "z_m", front.z),
        _scaled("rear_yaw_inertia", "yaw inertia of the rear frame", "rear_frame", "izz_kg_m2", rear.izz),
        _scaled("front_yaw_inertia", "yaw inertia of the front frame", "front_frame", "izz_kg_m2", front.izz),
        _scaled("rear_pitch_inertia", "pitch inertia of the rear frame", "rear_frame", "iyy_kg_m2", rear.iyy),
        _scaled("front_pitch_inertia", "pitch inertia of the front frame", "front_frame", "iyy_kg_m2", front.iyy),
        _scaled("rear_roll_inertia", "roll inertia of the rear frame", "rear_frame", "ixx_kg_m2", rear.ixx),
        _scaled("front_roll_inertia", "roll inertia of the front frame", "front_frame", "ixx_kg_m2", front.ixx),
        Quantity(
            "lift_arm_pitch",
            "pitch inertia of the lift arm",
            "kg m2",
            "machine",
            lambda v: m.lift_arm.iyy * (1.0 + v),
            (
                ("lift_arm", "iyy_kg_m2", lambda v: m.lift_arm.iyy * (1.0 + v)),
                ("lift_arm", "izz_kg_m2", lambda v: m.lift_arm.izz + m.lift_arm.iyy * v),
            ),
        ),
        _scaled("wheel_spin", "spin inertia of a wheel", "wheel", "spin_inertia_kg_m2", m.wheel.spin_inertia),
        _shifted("wheel_radius", "unloaded radius of a wheel", "m", "tyre", "radius_m", m.tyre.radius),
        Quantity(
            "tyre_stiffness",
            "vertical tyre stiffness at the nominal load",
            "N/m",
            "machine",
            lambda v: vertical_stiffness(m, v),
            (
                ("tyre", "qfz1", lambda v: m.tyre.qfz1 * (1.0 + v)),
                ("tyre", "qfz2", lambda v: m.tyre.qfz2 * (1.0 + v)),
            ),
        ),
        _scaled("slip_stiffness", "stiffness of a tyre along, at no slip (PKX1)", "tyre", "pkx1", m.tyre.pkx1, "1"),
        _scaled("cornering_stiffness", "stiffness of a tyre across, at no slip (PKY1)", "tyre", "pky1", m.tyre.pky1, "1"),
        # the bucket carries it, so it belongs to the drive and not to the machine file
        Quantity(PAYLOAD, "payload beyond that of the record", "kg", "machine", lambda v: v),
    ]  # fmt: skip
    found = [q for q in found if q.parameter in known]
    named = {q.parameter for q in found}
    sensors = [p for p in model.nuisances if p.scope == "all" and p.name not in named]
    return [*found, *(Quantity(p.name, sensor_label(p.name), p.unit, "sensor", lambda v: v) for p in sensors)]


def vertical_stiffness(machine: Machine, stiffer: float = 0.0) -> float:
    """Slope of load over deflection of a tyre at nominal load and pressure [N/m]; stiffer: share by which both coefficients are larger."""
    t = machine.tyre
    nominal = Nominal(load=t.nominal_load, pressure=t.nominal_pressure * 1e5, radius=t.radius)
    return nominal_stiffness(t.qfz1 * (1.0 + stiffer), t.qfz2 * (1.0 + stiffer), nominal)


def sensor_label(parameter: str) -> str:
    """'zero point of yaw rate' for 'zero.yaw_rate'."""
    if parameter == "torque_scale":
        return "scale error of the wheel torques"
    kind, dot, channel = parameter.partition(".")
    if not dot:  # of the joint angles: articulation_zero
        return f"zero point of {parameter.removesuffix('_zero')} angle"
    return f"{'zero point' if kind == 'zero' else 'scale error'} of {channel.replace('_', ' ')}"


def sensor_entry(parameter: str, value: float, sheet: SensorParameters) -> tuple[str, str, float]:
    """Channel, key and number by which an equipment file has a zero point or scale of this value."""
    if parameter == "torque_scale":
        return "wheel_torque", "scale_error_percent", 100.0 * value
    kind, _, channel = parameter.partition(".")
    channel = JOINTS.get(parameter, channel)
    return channel, *entry(channel, "scale" if kind == "scale" else "bias", value, sheet.of(channel))


def machine_lines(
    found: Sequence[Quantity], values: dict[str, float], comments: dict[str, str]
) -> list[Line]:
    """Lines of a machine file for the quantities at these values of the parameters; comments: by parameter."""
    return [
        Line((table,), key, value(values[q.parameter]), comments[q.parameter])
        for q in found
        for table, key, value in q.keys
    ]


def _shifted(parameter: str, label: str, unit: str, table: str, key: str, sheet: float) -> Quantity:
    def value(v: float) -> float:
        return sheet + v

    return Quantity(parameter, label, unit, "machine", value, ((table, key, value),))


def _scaled(parameter: str, label: str, table: str, key: str, sheet: float, unit: str = "kg m2") -> Quantity:
    def value(v: float) -> float:
        return sheet * (1.0 + v)

    return Quantity(parameter, label, unit, "machine", value, ((table, key, value),))
