"""Variants of the sheet's machine: other values of nuisances and effects, as the simulation of the loader's model needs them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from discrepancy.models.loader.library import LONG_MEMORY, fitted, searched
from plant.effects.effect import Effect
from plant.sheets.machine import Machine


@dataclass(frozen=True, slots=True)
class Variants:
    """Variants of one machine. Values go by the names of the model's parameters; a missing one is that of the sheet, or off."""

    machine: Machine
    effects: Mapping[str, Effect] = field(default_factory=searched)

    def having(self, values: Mapping[str, float]) -> Machine:
        """The machine with the nuisances' values, and with the effects that are not at their off values."""
        m = self.machine
        stiffer = 1.0 + values.get("tyre_stiffness", 0.0)
        # both coefficients together: the spring's curve keeps its form
        tyre = replace(
            m.tyre,
            qfz1=m.tyre.qfz1 * stiffer,
            qfz2=m.tyre.qfz2 * stiffer,
            radius=m.tyre.radius + values.get("wheel_radius", 0.0),
        )
        rear = replace(
            m.rear_frame,
            mass=m.rear_frame.mass + values.get("rear_mass", 0.0),
            z=m.rear_frame.z + values.get("rear_height", 0.0),
        )
        front = replace(m.front_frame, mass=m.front_frame.mass + values.get("front_mass", 0.0))
        chosen = [
            item.of(**{p.name: values[f"{name}.{p.name}"] for p in item.parameters if fitted(name, p)})
            for name, item in self.effects.items()
            if _is_on(name, item, values)
        ]
        return replace(m, tyre=tyre, rear_frame=rear, front_frame=front, effects=(*m.effects, *chosen))

    def long_memory(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the effects of LONG_MEMORY. One that is off has its off values and no shapes, so that equal machines compare equal."""
        found: dict[str, float] = {}
        for name in LONG_MEMORY:
            item = self.effects[name]
            on = _is_on(name, item, values)
            found |= {
                f"{name}.{p.name}": values[f"{name}.{p.name}"] if on else p.off
                for p in item.parameters
                if fitted(name, p) and (on or not p.shape)
            }
        return found

    @property
    def parameter_names(self) -> set[str]:
        """Names of all parameters of the effects."""
        return {f"{name}.{p.name}" for name, item in self.effects.items() for p in item.parameters}


def _is_on(name: str, effect: Effect, values: Mapping[str, float]) -> bool:
    return any(values.get(f"{name}.{p.name}", p.off) != p.off for p in effect.parameters if not p.shape)
