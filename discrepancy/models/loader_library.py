"""What the loader has as a model: its channels, what its sheet does not know exactly, and its library of effects."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from discrepancy.model import Effect, Parameter
from discrepancy.sensors import sensor_effects
from plant.effects import effects as plant_effects
from plant.effects.effect import Effect as PlantEffect
from plant.effects.effect import Parameter as PlantParameter
from plant.sensors import WHEELS

UNSEARCHED: Final = frozenset(
    {
        "motor_lag",  # the torque is an input, with its lag
        "steering_play",  # as is the articulation
        "steering_compliance",
        "kerb",  # somewhere on the way: the open-ended part tells where
        "ditch",
        "enveloped_step",
        "wheel_rigid_ring",  # its modes are above what 100 Hz and the bus's filters show
    }
)
"""Effects of the plant that cannot be seen in, or not searched for by, this form of the model."""

FITTED_SHAPES: Final = frozenset(
    {
        "payload_slosh.frequency_hz",
        "payload_slosh.damping",
        "rolling_resistance.growth_per_m_per_s",
        "washboard.wavelength_m",
        "pile_entry.distance_m",
        "pile_entry.depth_m",
        "pile_entry.weight_share",
        "soil_sinkage.exponent",
        "brake_fade.capacity_J_per_K",
    }
)
"""Parameters that say how an effect acts and that a recording can tell; others stay typical."""

TORQUES = tuple(f"wheel_torque_{wheel}" for wheel in WHEELS)
SPEEDS = tuple(f"wheel_speed_{wheel}" for wheel in WHEELS)
INPUTS: Mapping[str, str] = {
    **dict.fromkeys(TORQUES, "N.m"),
    "articulation_angle": "rad",
    "articulation_rate": "rad/s",
    "lift_arm_angle": "rad",
    "tilt_angle": "rad",
}
OPTIONAL: Mapping[str, str] = {
    "torque_demand": "1",
    "brake_demand": "1",
    "articulation_rate_demand": "rad/s",
    "lift_demand": "1",
    "tilt_demand": "1",
}


@dataclass(frozen=True, slots=True)
class Channel:
    """An output: its unit, an error that matters, what its zero point and its scale may be off by, and what its sensor does."""

    unit: str
    typical: float
    zero: float
    columns: tuple[str, int | None]
    faults: tuple[str, ...] = ()
    scale: float = 0.0


GAUGE: Final = 2.5e-3  # of a pressure's reading: accuracy of the transducers in the equipment's sheet


def _machine_channels() -> dict[str, Channel]:
    faults = ("bias", "scale", "delay", "lag")
    return {
        **{
            name: Channel("rad/s", 0.05, 0.0, ("wheel_speed", i), ("scale", "delay"))
            for i, name in enumerate(SPEEDS)
        },
        **{
            f"acceleration_{axis}": Channel("m/s^2", 0.1, 0.1, ("imu_specific_force", i), faults)
            for i, axis in enumerate("xyz")
        },
        **{
            f"{axis}_rate": Channel("rad/s", 0.01, 0.006, ("angular_velocity", i), faults)
            for i, axis in enumerate(("roll", "pitch", "yaw"))
        },
        "pitch_angle": Channel("rad", 0.005, 0.005, ("pitch", None), ("bias", "delay", "lag")),
        "roll_angle": Channel("rad", 0.005, 0.005, ("roll", None), ("bias", "delay", "lag")),
        "lift_pressure": Channel(
            "Pa", 2e5, 1e5, ("lift_pressure", None), ("bias", "scale", "delay", "lag"), GAUGE
        ),
        "tilt_pressure": Channel("Pa", 2e5, 1e5, ("tilt_pressure", None), ("bias", "scale"), GAUGE),
        **{
            f"steering_pressure_{side}": Channel(
                "Pa", 2e5, 1e5, ("steering_pressure", i), ("bias", "scale"), GAUGE
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


CHANNELS: Mapping[str, Channel] = {**_machine_channels(), **_reference_channels()}


def zero(name: str) -> str:
    return f"zero.{name}"


def scale(name: str) -> str:
    return f"scale.{name}"


BOUNCE: Final = 12.0  # of the loader on its tyres [rad/s]
HEAVE_M: Final = 2e-3  # about 1 kN a wheel
TILT_RAD: Final = 2e-3
SPEED_M_S: Final = 0.05  # a quarter of it is left where a stretch is scored


def _begin(name: str, unit: str, sd: float) -> Parameter:
    return Parameter(name=f"begin.{name}", unit=unit, typical=sd, prior_sd=sd, scope="begin")


BEGINS = (
    _begin("height", "m", HEAVE_M),
    _begin("height_rate", "m/s", HEAVE_M * BOUNCE),
    _begin("roll", "rad", TILT_RAD),
    _begin("pitch", "rad", TILT_RAD),
    _begin("roll_rate", "rad/s", TILT_RAD * BOUNCE),
    _begin("pitch_rate", "rad/s", TILT_RAD * BOUNCE),
    _begin("speed", "m/s", SPEED_M_S),
)
"""What a stretch begins with and no sensor tells exactly. What the pilot misses of a hard stop rings on for seconds in a machine on soft tyres;
motions sideways and in the joints have died away before a stretch is scored.
"""

NUISANCES = (
    Parameter(name="rear_mass", unit="kg", lower=-1500.0, upper=1500.0, typical=100.0, prior_sd=120.0),
    Parameter(name="front_mass", unit="kg", lower=-800.0, upper=800.0, typical=50.0, prior_sd=60.0),
    Parameter(name="rear_height", unit="m", lower=-0.4, upper=0.4, typical=0.03, prior_sd=0.05),
    Parameter(name="tyre_stiffness", unit="1", lower=-0.5, upper=1.0, typical=0.05, prior_sd=0.05),
    Parameter(name="torque_scale", unit="1", lower=-0.2, upper=0.2, typical=0.02, prior_sd=0.02),
    Parameter(name="articulation_zero", unit="rad", lower=-0.05, upper=0.05, typical=0.003, prior_sd=0.004),
    Parameter(name="lift_zero", unit="rad", lower=-0.05, upper=0.05, typical=0.004, prior_sd=0.005),
    Parameter(name="tilt_zero", unit="rad", lower=-0.05, upper=0.05, typical=0.004, prior_sd=0.005),
    Parameter(name="wheel_radius", unit="m", lower=-0.03, upper=0.03, typical=0.002, prior_sd=0.002),
    *(
        Parameter(name=zero(name), unit=channel.unit, typical=channel.zero, prior_sd=channel.zero)
        for name, channel in CHANNELS.items()
        if channel.zero > 0.0
    ),
    *(
        Parameter(
            name=scale(name), unit="1", lower=-0.05, upper=0.05, typical=channel.scale, prior_sd=channel.scale
        )
        for name, channel in CHANNELS.items()
        if channel.scale > 0.0
    ),
    *BEGINS,
)


def _engine_parameter(effect: str, p: PlantParameter) -> Parameter:
    """In its own unit; a shape begins at its typical value."""
    change = 0.2 * (p.typical or p.high) if p.shape else p.typical - p.off or 0.1 * (p.high - p.low)
    return Parameter(
        name=f"{effect}.{p.name}",
        unit=p.unit,
        value=p.typical - change if p.shape else p.off,
        lower=p.low,
        upper=p.high,
        typical=change,
        shape=p.shape,
        small=False,
    )


LASTING: Final = ("pile_entry",)
"""Effects that remember for longer than a lead-in: a pile that is dug into. A stretch begins with what was before it. Brakes that are hot would
be another; a whole flight for each of their sizes costs more than their heat has been seen to matter.
"""


def fitted(effect: str, p: PlantParameter) -> bool:
    return not p.shape or f"{effect}.{p.name}" in FITTED_SHAPES


def _engine_effect(item: PlantEffect) -> Effect:
    """An effect of the plant in the words of the engine."""
    return Effect(
        name=item.name,
        sentence=item.sentence.rstrip("."),
        equation=item.equation,
        parameters=tuple(_engine_parameter(item.name, p) for p in item.parameters if fitted(item.name, p)),
        kind="physics",
        place=item.acts_on,
        excited_by=item.excited_by,
        confusable={c.name: c.separate for c in item.confusable},
    )


def searched() -> dict[str, PlantEffect]:
    """Effects of the plant that this model searches: those of physics that vanish somewhere."""
    return {
        name: item
        for name, item in plant_effects().items()
        if item.sensors is None and name not in UNSEARCHED and not all(p.shape for p in item.parameters)
    }


def library() -> tuple[Effect, ...]:
    """The plant's physics, and the faults of every sensor."""
    physics = [_engine_effect(item) for item in searched().values()]
    faults = [
        fault
        for name, channel in CHANNELS.items()
        if channel.faults
        for fault in sensor_effects(name, channel.unit, bias=2.0 * channel.typical, kinds=channel.faults)
    ]
    return (*physics, *faults)
