"""The loader with what a diagnosis found: a machine file, its equipment's errors and the ECU's calibration beside it.

MACHINE.toml holds the physics as [effects.NAME]; MACHINE.equipment.toml, where a sensor's fault was found, its sensors;
MACHINE.calibration.toml what the ECU has to know. `loaderhil run --machine MACHINE.toml` takes all three,
`loaderhil diagnose --with MACHINE.toml` the first two as its baseline.
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
    with_stories,
)
from diagnosis.apply.toml_text import Line, laid_over
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
"""The machine that the loader's model has by itself."""


def baseline(machine_file: Path, recordings: Sequence[Recording]) -> Model:
    """The loader's model of a machine file and the equipment beside it. Raises ConfigurationError, BadExtension."""
    for kind in (EQUIPMENT, CALIBRATION):
        if machine_file.name.endswith(kind):
            beside = machine_file.name.removesuffix(kind) + ".toml"
            raise BadExtension(f"{machine_file}: goes with a machine file; give that one, {beside}")
    machine = load_machine(machine_file)
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
    """Parameters of the machine's effects by effect, in their own units."""
    return {
        item.effect.name: {
            p.name: value / p.si for p, value in zip(item.effect.parameters, item.values, strict=True)
        }
        for item in machine.effects
    }


def _sensors(machine_file: Path, machine: Machine) -> SensorParameters:
    """The sensors of the equipment beside a machine file, or of its family's, as effects of the machine change them."""
    equipment = load_equipment(companion(machine_file, EQUIPMENT) or machine.family)
    return faulty(equipment.sensors, machine.effects)


def _faults(sheet: SensorParameters, sensors: SensorParameters, model: Model) -> Values:
    """What sensors do beyond the sheet's, as effects of the model."""
    found: dict[str, dict[str, float]] = {}
    for effect in [e for e in model.effects if e.kind == "sensor"]:
        (parameter,) = effect.parameters
        channel, _, kind = parameter.name.rpartition(".")
        old, new = sheet.of(channel), sensors.of(channel)
        if kind in ("bias", "scale"):
            field = {"bias": "bias", "scale": "scale_error"}[kind]
            value = getattr(new, field) if getattr(new, field) != getattr(old, field) else 0.0
        else:
            value = getattr(new, kind) - getattr(old, kind)
        if value != 0.0:
            found[effect.name] = {parameter.name: value}
    return found


def extended_files(result: Findings, base: Path | None, out: Path) -> Outcome:
    """Machine, equipment and calibration with what was found; base: name or file of the machine that was the baseline."""
    machine = load_machine(base or BASE)
    found = [_in_plant_words(item) for item in applied(result)]
    physics = [item for item in found if item.kind == "physics"]
    faults = [item for item in found if item.kind == "sensor"]
    sensors, refused = _sensor_lines(faults, machine)
    calibration, unfollowed = _calibration(found, machine, base)
    said = [*not_applied(result), *refused, *unfollowed]
    file = base if base and base.suffix == ".toml" else MACHINES / f"{base or BASE}.toml"
    files = {
        out: with_stories(extended_text(file.read_text(encoding="utf-8"), physics), found, said),
        named(out, CALIBRATION): calibration,
    }
    equipment = companion(base, EQUIPMENT) if base else None
    if sensors or equipment or named(out, EQUIPMENT).is_file():  # an older one would be taken
        text = (equipment or FOLDER / f"{machine.family}.toml").read_text(encoding="utf-8")
        files[named(out, EQUIPMENT)] = laid_over(text, sensors)
    return Outcome(files, said)


def _in_plant_words(item: Applied) -> Applied:
    """Parameters of a physical effect as the machine file calls them: without the effect's name before the dot."""
    if item.kind == "sensor":
        return item

    def own(name: str) -> str:
        return name.partition(".")[2]

    return replace(
        item,
        values={own(name): value for name, value in item.values.items()},
        told={own(name): text for name, text in item.told.items()},
    )


def _calibration(found: Sequence[Applied], machine: Machine, base: Path | None) -> tuple[str, Sequence[str]]:
    """Text of the ECU's calibration, and a sentence per effect that it does not follow.

    A calibration beside the baseline was made for the baseline's effects; that of the family knows of none.
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
        """With the parameters that were not searched, as the plant will have them."""
        if item.kind == "sensor":
            return item
        typical = {p.name: p.typical for p in library[item.effect].parameters}
        return replace(item, values={**typical, **own.get(item.effect, {}), **item.values})

    unknown = {} if beside else {name: Applied(name, "physics", values, ()) for name, values in own.items()}
    new = {**unknown, **{item.effect: whole(item) for item in found}}
    off = {name: {p.name: p.off for p in item.parameters} for name, item in library.items()}
    followed = calibrated(list(new.values()), old, {**off, **own} if beside else off, machine)
    return laid_over(file.read_text(encoding="utf-8"), followed.lines), followed.said


def _sensor_lines(faults: Sequence[Applied], machine: Machine) -> tuple[list[Line], list[str]]:
    """Sections of the channels' sensors, and the faults that no equipment can have.

    The model knows lag and delay of the sheet and finds what is beyond them; it takes bias and scale as none. What an effect of
    the machine (gyro_bias, sensor_delay) does already is no part of the line.
    """
    sheet = load_equipment(machine.family).sensors
    told = faulty(sheet, machine.effects)
    lines, refused = [], []
    for item in faults:
        ((name, value),) = item.values.items()
        channel, _, kind = name.rpartition(".")
        value = _left(kind, value, sheet.of(channel), told.of(channel))
        key, number = entry(channel, kind, value, sheet.of(channel))
        if kind in ("lag", "delay") and number < 0.0:
            refused.append(
                f"{item.effect} of {value:.4g} s is not applied: the sensor would know the future; is the sheet's delay too long?"
            )
        else:
            lines.append(Line(("sensors", channel), key, number, item.told[name]))
    return lines, refused


def _left(kind: str, value: float, sheet: ChannelParameters, told: ChannelParameters) -> float:
    """What of a fault is left for the equipment where effects of the machine have made `told` of the sheet's sensor."""
    if kind == "scale":
        return (1.0 + value) * (1.0 + sheet.scale_error) / (1.0 + told.scale_error) - 1.0
    return value - (getattr(told, kind) - getattr(sheet, kind))


def entry(channel: str, kind: str, value: float, sheet: ChannelParameters) -> tuple[str, float]:
    """Key and number of an equipment file for a fault in SI; lag and delay come on top of the sheet's."""
    if kind == "bias":
        family = CHANNELS[channel].family
        return f"bias_{family.suffix}", value / family.factor
    if kind == "scale":
        return "scale_error_percent", 100.0 * value
    return f"{kind}_ms", 1e3 * (getattr(sheet, kind) + value)
