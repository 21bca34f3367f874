"""The ECU's calibration for a machine with effects, as far as the ECU's estimators have a parameter for them.

The ECU's model lumps several bodies of the plant into two (front and rear). An effect that moves mass or inertia of one of the plant's
bodies changes a lumped body by that body's share, which comes from the machine file.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from diagnosis.apply.extension import Applied, BadExtension
from diagnosis.apply.toml_text import Line
from plant.sheets.machine import Machine

Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Moved:
    """Parameters of an effect, now and when the calibration was made. The calibration already contains `before`."""

    now: Values  # by name, in the parameter's own unit
    before: Values

    def by(self, name: str) -> float:
        """The change of a parameter that adds to a value."""
        return self.now[name] - self.before[name]

    def times(self, name: str) -> float:
        """The change of a parameter that is a factor on a value. Raises BadExtension where the old factor is 0."""
        if self.before[name] == 0.0:
            raise BadExtension(
                f"{name} is 0 in the baseline, so the calibration beside that file cannot be scaled to the new value; "
                "move the calibration file away, then the calibration of the machine's family is used"
            )
        return self.now[name] / self.before[name]


Number = Callable[[str], float]
"""The value of 'table.key' in the calibration, in the unit of the key."""
Changes = dict[str, float]  # new values by 'table.key'


def _rolling(v: Moved, old: Number, _: Machine) -> Changes:
    return {"wheel.rolling_resistance": v.now["coefficient"]}


def _wear(v: Moved, old: Number, _: Machine) -> Changes:
    """The ECU has one radius for all wheels: it loses the mean wear of both axles."""
    worn = 0.5e-3 * (v.by("front_mm") + v.by("rear_mm"))
    return {"wheel.unloaded_radius_m": old("wheel.unloaded_radius_m") - worn}


def _pressure(v: Moved, old: Number, _: Machine) -> Changes:
    return {
        f"wheel.{axle}_pressure_bar": old(f"wheel.{axle}_pressure_bar") + v.by(f"{axle}_bar")
        for axle in ("front", "rear")
    }


def _split(v: Moved, old: Number, machine: Machine) -> Changes:
    """Mass moved from the rear frame to the front frame, which is part of the ECU's lumped front body."""
    moved, mass, frame = v.by("forward_kg"), old("front.mass_kg"), machine.front_frame

    def lumped(key: str, place: float) -> float:
        # centre of gravity of the old lumped body and of the mass that is added at the frame's own centre
        return (mass * old(key) + moved * place) / (mass + moved)

    return {
        "front.mass_kg": mass + moved,
        "front.x_m": lumped("front.x_m", frame.x),
        "front.z_m": lumped("front.z_m", frame.z),
        # the rear's mass is taken at its own centre of gravity, so its x_m stays
        "rear.mass_kg": old("rear.mass_kg") - moved,
        "rear.z_m": old("rear.z_m") + 1e-3 * v.by("higher_mm"),
    }


def _inertia(axis: str, plant_field: str) -> "Rule":
    """The rule of an effect that scales the inertia of a frame: the lumped body gains the frame's part only."""

    def rule(v: Moved, old: Number, machine: Machine) -> Changes:
        frames = {"front": machine.front_frame, "rear": machine.rear_frame}
        return {
            f"{end}.{axis}_inertia_kg_m2": old(f"{end}.{axis}_inertia_kg_m2")
            + v.by(end) * getattr(frame, plant_field)
            for end, frame in frames.items()
        }

    return rule


def _spin(v: Moved, old: Number, _: Machine) -> Changes:
    return {"wheel.spin_inertia_kg_m2": old("wheel.spin_inertia_kg_m2") + v.by("extra_kg_m2")}


def _arm(v: Moved, old: Number, _: Machine) -> Changes:
    return {
        "arm.pitch_inertia_kg_m2": old("arm.pitch_inertia_kg_m2") + v.by("inertia_kg_m2"),
        "arm.above_m": old("arm.above_m") + 1e-3 * v.by("higher_mm"),
    }


def _axles(v: Moved, old: Number, _: Machine) -> Changes:
    return {
        f"geometry.{end}_length_m": old(f"geometry.{end}_length_m") + 1e-3 * v.by(f"{end}_mm")
        for end in ("front", "rear")
    }


def _relaxation(v: Moved, old: Number, _: Machine) -> Changes:
    return {"wheel.longitudinal_relaxation_m": old("wheel.longitudinal_relaxation_m") * v.times("factor")}


def _spring(v: Moved, old: Number, _: Machine) -> Changes:
    stiffer = {
        f"wheel.{key}": old(f"wheel.{key}") * v.times("stiffness")
        for key in ("radial_linear", "radial_quadratic")
    }
    return {"contact.damping_kn_s_per_m": old("contact.damping_kn_s_per_m") * v.times("damping"), **stiffer}


Rule = Callable[[Moved, Number, Machine], Changes]
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
"""By effect of the plant: the rule for its parameters in the calibration. Other effects have none in the ECU."""

# measured by the ECU itself, so a calibrated value would count the effect twice
NO_NEED: Mapping[str, str] = {
    "payload_mass": "the ECU measures the payload through the lift pressure",
    "grade": "the ECU measures the slope",
}


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Changes of a calibration file."""

    lines: Sequence[Line]
    messages: Sequence[str]  # one sentence per effect that changes nothing


def calibrated(
    found: Sequence[Applied], old: Number, before: Mapping[str, Values], machine: Machine
) -> Calibrated:
    """The calibration of a machine that has these effects, with all their parameters.

    old: values of the calibration so far, in the file's units; before: by effect, the parameters that it was made for.
    """
    lines: dict[str, Line] = {}
    messages = []
    for item in found:
        rule = RULES.get(item.effect) if item.kind == "physics" else None
        if rule is None:
            messages.append(_unchanged(item))
            continue

        # two effects may change one key; the second then starts from the value that the first has made
        def now(key: str) -> float:
            return lines[key].value if key in lines else old(key)

        for key, value in rule(Moved(item.values, before[item.effect]), now, machine).items():
            if value == now(key):
                continue
            table, _, name = key.partition(".")
            comment = f"was {old(key):g}; {item.effect}"
            lines[key] = Line(
                (table,),
                name,
                value,
                comment if key not in lines else f"{lines[key].comment}, {item.effect}",
            )
    return Calibrated(list(lines.values()), messages)


def _unchanged(item: Applied) -> str:
    """A sentence on why an effect does not change the calibration."""
    if item.effect in NO_NEED:
        return f"the ECU's calibration need not follow {item.effect}: {NO_NEED[item.effect]}"
    why = (
        "its sensors have no errors in the calibration"
        if item.kind == "sensor"
        else "its estimators have no such term"
    )
    return f"the ECU's calibration does not follow {item.effect}: {why}"
