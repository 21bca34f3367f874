"""Effects that a diagnosis of the loader searches: the plant's effect library, and faults of every sensor."""

from typing import Final

from discrepancy.model.description import Effect, Parameter
from discrepancy.model.sensors import sensor_effects
from discrepancy.models.loader.channels import CHANNELS
from plant.effects import effects as plant_effects
from plant.effects.effect import Effect as PlantEffect
from plant.effects.effect import Parameter as PlantParameter
from plant.effects.registry import python_hook

UNSEARCHED: Final = frozenset(
    {
        "motor_lag",  # the measured torque, an input, contains the lag already
        "steering_play",  # the measured articulation, an input, contains them already
        "steering_compliance",
        "kerb",  # at an unknown place of the road: a fit would have to find it first; the open-ended search shows the place
        "ditch",
        "enveloped_step",
        "wheel_rigid_ring",  # its modes lie above what 100 Hz and the filters of the sensors pass
    }
)
"""Effects of the plant that this form of the model cannot show, or cannot be searched with it."""

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
"""Shape parameters that a recording can determine; all others stay at their typical values."""

LONG_MEMORY: Final = ("pile_entry",)
"""Effects that remember for longer than a lead-in: the depth dug into a pile. Their warm-up run has to have them too.

Hot brakes would be another one. They are left out: each of their sizes would need a warm-up run over the whole recording, and their heat has
not mattered in the benchmark.
"""


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


def searched() -> dict[str, PlantEffect]:
    """Effects of the plant that are searched: physics that a value of its parameters switches off."""
    return {
        name: item
        for name, item in plant_effects().items()
        if python_hook(item, "sensors") is None
        and name not in UNSEARCHED
        and not all(p.shape for p in item.parameters)
    }


def fitted(effect: str, p: PlantParameter) -> bool:
    """Whether a parameter of an effect is fitted; other shape parameters stay at their typical values."""
    return not p.shape or f"{effect}.{p.name}" in FITTED_SHAPES


def _engine_effect(item: PlantEffect) -> Effect:
    """An effect of the plant in the form that the engine takes."""
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


def _engine_parameter(effect: str, p: PlantParameter) -> Parameter:
    """A parameter in its own unit. An amplitude starts at its off value; a shape is first tried at its typical value."""
    # a typical change of a shape is a fifth of its typical value; of an amplitude without a typical value, a tenth of its range
    change = 0.2 * (p.typical or p.high) if p.shape else p.typical - p.off or 0.1 * (p.high - p.low)
    return Parameter(
        name=f"{effect}.{p.name}",
        unit=p.unit,
        value=p.typical - change if p.shape else p.off,
        lower=p.low,
        upper=p.high,
        typical=change,
        shape=p.shape,
        small=False,  # every simulation costs seconds
        trial_steps=p.trial_steps,
    )
