"""The loader with the effects of a diagnosis: a machine file, with equipment and ECU calibration beside it.

MACHINE.toml holds physical effects as [effects.NAME]. MACHINE.equipment.toml is written where a sensor fault was found.
MACHINE.calibration.toml holds the parameters of the ECU's estimators. `loaderhil run --machine MACHINE.toml` reads all three files,
`loaderhil diagnose --with MACHINE.toml` reads the first two as its baseline.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from configuration import read_toml
from diagnosis.apply.calibration import calibrated
from diagnosis.apply.extension import (
    Applied,
    BadExtension,
    Outcome,
    Values,
    applied,
    extended,
    extended_text,
    not_applied,
    with_summaries,
)
from diagnosis.apply.toml_text import Line, with_values
from discrepancy.model.description import Model
from discrepancy.models.loader import model as loader
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Recording
from ecu.calibration import CALIBRATIONS
from hil.companions import CALIBRATION, EQUIPMENT, companion, named
from plant.effects import effects
from plant.sheets.machine import MACHINES, Machine, load_machine
from plant.unit.equipment import FOLDER, load_equipment
from plant.unit.sensor_parameters import ChannelParameters, SensorParameters
from plant.unit.sensors import faulty
from plant.unit.signals import CHANNELS

BASE = "l60"
"""The machine of the loader's model where no other is given."""


def baseline(machine_file: Path, recordings: Sequence[Recording]) -> Model:
    """The loader's model of a machine file and the equipment beside it. Raises ConfigurationError, BadExtension."""
    for kind in (EQUIPMENT, CALIBRATION):
        if machine_file.name.endswith(kind):
            beside = machine_file.name.removesuffix(kind) + ".toml"
            raise BadExtension(f"{machine_file}: belongs to a machine file; give that file, {beside}")
    machine = load_machine(machine_file)
    # Effects of the machine that the model's library contains become baseline values, so that a change of them can be found.
    # The others stay switched on in the plant that the model simulates.
    searched = {effect.name: effect for effect in loader.model().effects}
    others = tuple(item for item in machine.effects if item.effect.name not in searched)
    model = loader.model(recordings, machine=replace(machine, effects=others))
    values: dict[str, dict[str, float]] = {}
    for name, own in _effects_of(machine).items():
        if name in searched:
            kept = {p.name for p in searched[name].parameters}
            values[name] = {f"{name}.{key}": v for key, v in own.items() if f"{name}.{key}" in kept}
    sheet, own_sensors = load_equipment(machine.family).sensors, _sensors(machine_file, machine)
    return extended(model, {**values, **_faults(sheet, own_sensors, model)})


def _effects_of(machine: Machine) -> dict[str, dict[str, float]]:
    """Parameters of the machine's effects by effect and name, in their own units (the machine holds SI)."""
    return {
        item.effect.name: {
            p.name: value / p.si for p, value in zip(item.effect.parameters, item.values, strict=True)
        }
        for item in machine.effects
    }


def _sensors(machine_file: Path, machine: Machine) -> SensorParameters:
    """Sensor parameters from the equipment beside a machine file, else of its family, changed by the machine's own sensor effects."""
    equipment = load_equipment(companion(machine_file, EQUIPMENT) or machine.family)
    return faulty(equipment.sensors, machine.effects)


def _faults(sheet: SensorParameters, sensors: SensorParameters, model: Model) -> Values:
    """Differences of sensors from the family's sheet, as parameters of the model's sensor effects."""
    found: dict[str, dict[str, float]] = {}
    for effect in [e for e in model.effects if e.kind == "sensor"]:
        (parameter,) = effect.parameters
        channel, _, kind = parameter.name.rpartition(".")
        old, new = sheet.of(channel), sensors.of(channel)
        # The model takes bias and scale of the sheet as unknown, so it starts from 0 and finds the whole of them; lag and delay of
        # the sheet are in the model, which finds only the difference.
        if kind in ("bias", "scale"):
            field = {"bias": "bias", "scale": "scale_error"}[kind]
            value = getattr(new, field) if getattr(new, field) != getattr(old, field) else 0.0
        else:
            value = getattr(new, kind) - getattr(old, kind)
        if value != 0.0:
            found[effect.name] = {parameter.name: value}
    return found


def extended_files(result: Findings, base: Path | None, out: Path) -> Outcome:
    """Machine, equipment and calibration with the named effects; base: name or file of the machine that was the baseline."""
    machine = load_machine(base or BASE)
    found = [_with_plant_names(item) for item in applied(result)]
    physics = [item for item in found if item.kind == "physics"]
    faults = [item for item in found if item.kind == "sensor"]
    sensors, refused = _sensor_lines(faults, machine)
    calibration, unfollowed = _calibration(found, machine, base)
    messages = [*not_applied(result), *refused, *unfollowed]
    file = base if base and base.suffix == ".toml" else MACHINES / f"{base or BASE}.toml"
    files = {
        out: with_summaries(extended_text(file.read_text(encoding="utf-8"), physics), found, messages),
        named(out, CALIBRATION): calibration,
    }
    equipment = companion(base, EQUIPMENT) if base else None
    # also without a sensor fault, where a file of that name exists: `run` would read the old one with the new machine
    if sensors or equipment or named(out, EQUIPMENT).is_file():
        text = (equipment or FOLDER / f"{machine.family}.toml").read_text(encoding="utf-8")
        files[named(out, EQUIPMENT)] = with_values(text, sensors)
    return Outcome(files, messages)


def _with_plant_names(item: Applied) -> Applied:
    """The effect with parameter names as in a machine file: 'coefficient', not 'rolling_resistance.coefficient'."""
    if item.kind == "sensor":
        return item

    def own(name: str) -> str:
        return name.partition(".")[2]

    return replace(
        item,
        values={own(name): value for name, value in item.values.items()},
        comments={own(name): text for name, text in item.comments.items()},
    )


def _calibration(found: Sequence[Applied], machine: Machine, base: Path | None) -> tuple[str, Sequence[str]]:
    """Text of the ECU's calibration, and a sentence per effect that it does not follow.

    A calibration beside the baseline's file was made for the baseline's effects; the family's calibration is for a machine without effects.
    """
    beside = companion(base, CALIBRATION) if base else None
    file = beside or CALIBRATIONS / f"{machine.family}.toml"
    tables, library, own = read_toml(file), effects(), _effects_of(machine)

    def old(key: str) -> float:
        table, _, name = key.partition(".")
        entry = tables[table]
        assert isinstance(entry, dict)
        return float(entry[name])

    def whole(item: Applied) -> Applied:
        """The effect with all parameters that the plant will use: found, from the baseline, or typical (not searched)."""
        if item.kind == "sensor":
            return item
        typical = {p.name: p.typical for p in library[item.effect].parameters}
        return replace(item, values={**typical, **own.get(item.effect, {}), **item.values})

    # effects of the baseline that the calibration does not yet contain, and the new ones in their place
    unknown = {} if beside else {name: Applied(name, "physics", values, ()) for name, values in own.items()}
    new = {**unknown, **{item.effect: whole(item) for item in found}}
    off = {name: {p.name: p.off for p in item.parameters} for name, item in library.items()}
    followed = calibrated(list(new.values()), old, {**off, **own} if beside else off, machine)
    return with_values(file.read_text(encoding="utf-8"), followed.lines), followed.messages


def _sensor_lines(faults: Sequence[Applied], machine: Machine) -> tuple[list[Line], list[str]]:
    """Lines of the equipment file, and a sentence for each fault that no equipment can have.

    The model contains lag and delay of the sheet and finds the difference; of bias and scale it finds the whole. The part that an effect
    of the machine causes (gyro_bias, sensor_delay) stays in the machine file and is subtracted here.
    """
    sheet = load_equipment(machine.family).sensors
    changed = faulty(sheet, machine.effects)
    lines, refused = [], []
    for item in faults:
        ((name, value),) = item.values.items()
        channel, _, kind = name.rpartition(".")
        value = _remaining(kind, value, sheet.of(channel), changed.of(channel))
        key, number = entry(channel, kind, value, sheet.of(channel))
        if kind in ("lag", "delay") and number < 0.0:
            refused.append(
                f"{item.effect} of {value:.4g} s is not applied: the total {kind} would be negative; is the {kind} in the sheet too long?"
            )
        else:
            lines.append(Line(("sensors", channel), key, number, item.comments[name]))
    return lines, refused


def _remaining(kind: str, value: float, sheet: ChannelParameters, changed: ChannelParameters) -> float:
    """The part of a fault that is left for the equipment; changed: the sheet's sensor with the machine's own effects."""
    if kind == "scale":  # factors multiply, all other errors add
        return (1.0 + value) * (1.0 + sheet.scale_error) / (1.0 + changed.scale_error) - 1.0
    return value - (getattr(changed, kind) - getattr(sheet, kind))


def entry(channel: str, kind: str, value: float, sheet: ChannelParameters) -> tuple[str, float]:
    """Key and value of an equipment file for a fault in SI; lag and delay are added to those of the sheet."""
    if kind == "bias":
        family = CHANNELS[channel].family
        return f"bias_{family.suffix}", value / family.factor
    if kind == "scale":
        return "scale_error_percent", 100.0 * value
    return f"{kind}_ms", 1e3 * (getattr(sheet, kind) + value)
