"""The ECU's calibration for a machine with effects: what its estimators have a number for, and what not.

The ECU knows lumped bodies; where an effect moves mass or inertia of one of the plant's, the share of that body comes from the
machine file.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from hil.diagnose.extension import Applied
from hil.diagnose.tomltext import Line
from plant.machine import Machine

Values = Mapping[str, float]
Number = Callable[[str], float]
"""A number of the calibration by 'table.key', in the key's unit."""
Changes = dict[str, float]


def _rolling(v: Values, old: Number, _: Machine) -> Changes:
    return {"wheel.rolling_resistance": v["coefficient"]}


def _wear(v: Values, old: Number, _: Machine) -> Changes:
    """One radius for all wheels: the mean of both axles."""
    worn = 0.5e-3 * (v["front_mm"] + v["rear_mm"])
    return {"wheel.unloaded_radius_m": old("wheel.unloaded_radius_m") - worn}


def _pressure(v: Values, old: Number, _: Machine) -> Changes:
    return {
        f"wheel.{axle}_pressure_bar": old(f"wheel.{axle}_pressure_bar") + v[f"{axle}_bar"]
        for axle in ("front", "rear")
    }


def _split(v: Values, old: Number, machine: Machine) -> Changes:
    """Mass from the rear frame to the front frame, which is part of the ECU's lumped front body."""
    moved, mass, frame = v["forward_kg"], old("front.mass_kg"), machine.front_frame

    def lumped(key: str, place: float) -> float:
        return (mass * old(key) + moved * place) / (mass + moved)

    return {
        "front.mass_kg": mass + moved,
        "front.x_m": lumped("front.x_m", frame.x),
        "front.z_m": lumped("front.z_m", frame.z),
        "rear.mass_kg": old("rear.mass_kg") - moved,
        "rear.z_m": old("rear.z_m") + 1e-3 * v["higher_mm"],
    }


def _inertia(axis: str, plant_field: str) -> "Rule":
    """A factor on a frame's own inertia."""

    def rule(v: Values, old: Number, machine: Machine) -> Changes:
        frames = {"front": machine.front_frame, "rear": machine.rear_frame}
        return {
            f"{end}.{axis}_inertia_kg_m2": old(f"{end}.{axis}_inertia_kg_m2")
            + (v[end] - 1.0) * getattr(frame, plant_field)
            for end, frame in frames.items()
        }

    return rule


def _spin(v: Values, old: Number, _: Machine) -> Changes:
    return {"wheel.spin_inertia_kg_m2": old("wheel.spin_inertia_kg_m2") + v["extra_kg_m2"]}


def _arm(v: Values, old: Number, _: Machine) -> Changes:
    return {
        "arm.pitch_inertia_kg_m2": old("arm.pitch_inertia_kg_m2") + v["inertia_kg_m2"],
        "arm.above_m": old("arm.above_m") + 1e-3 * v["higher_mm"],
    }


def _axles(v: Values, old: Number, _: Machine) -> Changes:
    return {
        f"geometry.{end}_length_m": old(f"geometry.{end}_length_m") + 1e-3 * v[f"{end}_mm"]
        for end in ("front", "rear")
    }


def _relaxation(v: Values, old: Number, _: Machine) -> Changes:
    return {"wheel.longitudinal_relaxation_m": old("wheel.longitudinal_relaxation_m") * v["factor"]}


def _spring(v: Values, old: Number, _: Machine) -> Changes:
    stiffer = {
        f"wheel.{key}": old(f"wheel.{key}") * v["stiffness"] for key in ("radial_linear", "radial_quadratic")
    }
    return {"contact.damping_kn_s_per_m": old("contact.damping_kn_s_per_m") * v["damping"], **stiffer}


Rule = Callable[[Values, Number, Machine], Changes]
RULES: Mapping[str, Rule] = {
    "rolling_resistance": _rolling,
    "tyre_wear": _wear,
    "inflation_pressure": _pressure,
    "mass_split": _split,
    "roll_inertia": _inertia("roll", "ixx"),
    "yaw_inertia": _inertia("yaw", "izz"),
    "wheel_spin_inertia": _spin,
    "lift_arm_inertia": _arm,
    "axle_position": _axles,
    "longitudinal_relaxation": _relaxation,
    "vertical_damping": _spring,
}
"""What an effect of the plant, with all its parameters in their own units, changes of the calibration."""

NO_NEED: Mapping[str, str] = {
    "payload_mass": "the ECU weighs the payload by the lift pressure",
    "grade": "the ECU measures the slope",
}


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Lines for the calibration's file, and one sentence per effect that it cannot follow."""

    lines: Sequence[Line]
    unfollowed: Sequence[str]


def calibrated(found: Sequence[Applied], old: Number, machine: Machine) -> Calibrated:
    """Calibration of a machine that has these effects; old: the numbers before. Keys in the file's units."""
    lines: dict[str, Line] = {}
    unfollowed = []
    for item in found:
        rule = RULES.get(item.effect) if item.kind == "physics" else None
        if rule is None:
            why = (
                "its sensors have no errors in the calibration"
                if item.kind == "sensor"
                else "its estimators have no such term"
            )
            unfollowed.append(f"{item.effect}: {NO_NEED.get(item.effect, why)}")
            continue

        def now(key: str) -> float:
            return lines[key].value if key in lines else old(key)

        for key, value in rule(item.values, now, machine).items():
            if value == now(key):
                continue
            table, _, name = key.partition(".")
            told = f"was {old(key):g}; {item.effect}"
            lines[key] = Line(
                (table,), name, value, told if key not in lines else f"{lines[key].told}, {item.effect}"
            )
    return Calibrated(list(lines.values()), unfollowed)


def completed(item: Applied, off: Values) -> Applied:
    """With the parameters that the diagnosis does not search, at their values in the plant."""
    return replace(item, values={**off, **item.values})
