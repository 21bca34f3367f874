"""Variants of the sheet's machine: other values of nuisances and effects, as the simulation of the loader's model needs them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from discrepancy.models.loader.library import LONG_MEMORY, fitted, searched
from plant.effects.effect import Effect
from plant.sheets.machine import Body, Machine


@dataclass(frozen=True, slots=True)
class Variants:
    """Variants of one machine. Values go by the names of the model's parameters; a missing one is that of the sheet, or off."""

    machine: Machine
    effects: Mapping[str, Effect] = field(default_factory=searched)

    def having(self, values: Mapping[str, float]) -> Machine:
        """The machine with the nuisances' values, and with the effects that are not at their off values. Its bodies need not be rigid."""
        m = self.machine
        stiffer = 1.0 + values.get("tyre_stiffness", 0.0)
        # both coefficients together: the spring's curve keeps its form
        tyre = replace(
            m.tyre,
            qfz1=m.tyre.qfz1 * stiffer,
            qfz2=m.tyre.qfz2 * stiffer,
            radius=m.tyre.radius + values.get("wheel_radius", 0.0),
            # the slopes at no slip; friction, and with it the peaks, stays
            pkx1=m.tyre.pkx1 * (1.0 + values.get("slip_stiffness", 0.0)),
            pky1=m.tyre.pky1 * (1.0 + values.get("cornering_stiffness", 0.0)),
        )
        rear = replace(
            m.rear_frame,
            mass=m.rear_frame.mass + values.get("rear_mass", 0.0),
            x=m.rear_frame.x + values.get("rear_x", 0.0),
            z=m.rear_frame.z + values.get("rear_height", 0.0),
            **_inertias(m.rear_frame, "rear", values),
        )
        front = replace(
            m.front_frame,
            mass=m.front_frame.mass + values.get("front_mass", 0.0),
            x=m.front_frame.x + values.get("front_x", 0.0),
            z=m.front_frame.z + values.get("front_height", 0.0),
            **_inertias(m.front_frame, "front", values),
        )
        # the same mass further out resists pitch and yaw alike
        further = m.lift_arm.iyy * values.get("lift_arm_pitch", 0.0)
        arm = replace(m.lift_arm, iyy=m.lift_arm.iyy + further, izz=m.lift_arm.izz + further)
        wheel = replace(m.wheel, spin_inertia=m.wheel.spin_inertia * (1.0 + values.get("wheel_spin", 0.0)))
        chosen = [
            item.of(**{p.name: values[f"{name}.{p.name}"] for p in item.parameters if fitted(name, p)})
            for name, item in self.effects.items()
            if _is_on(name, item, values)
        ]
        return replace(
            m,
            tyre=tyre,
            rear_frame=rear,
            front_frame=front,
            lift_arm=arm,
            wheel=wheel,
            effects=(*m.effects, *chosen),
        )

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


def _inertias(frame: Body, end: str, values: Mapping[str, float]) -> dict[str, float]:
    """Of a frame, each with its own share of change."""
    return {
        key: getattr(frame, key) * (1.0 + values.get(f"{end}_{axis}_inertia", 0.0))
        for key, axis in (("ixx", "roll"), ("iyy", "pitch"), ("izz", "yaw"))
    }


def _is_on(name: str, effect: Effect, values: Mapping[str, float]) -> bool:
    return any(values.get(f"{name}.{p.name}", p.off) != p.off for p in effect.parameters if not p.shape)
