"""The loader with what a diagnosis found: a machine file, its equipment's errors and the ECU's calibration beside it.

MACHINE.toml holds the physics as [effects.NAME]; MACHINE.equipment.toml, where a sensor's fault was found, its sensors;
MACHINE.calibration.toml what the ECU has to know. `loaderhil run --machine MACHINE.toml` takes all three,
`loaderhil diagnose --with MACHINE.toml` the first two as its baseline.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from discrepancy.findings import Findings
from discrepancy.model import Model
from discrepancy.models import loader
from discrepancy.recording import Recording
from ecu.calibration import CALIBRATIONS
from ecu.quantity import read_toml
from hil.companions import CALIBRATION, EQUIPMENT, companion, named
from hil.diagnose.calibrated import calibrated, completed
from hil.diagnose.extension import (
    Applied,
    Outcome,
    Values,
    applied,
    extended,
    extended_text,
    not_applied,
    with_stories,
)
from hil.diagnose.tomltext import Line, laid_over
from plant.effects import effects
from plant.equipment import FOLDER, load_equipment
from plant.machine import MACHINES, load_machine
from plant.sensors import CHANNELS, FAMILIES, ChannelParameters

BASE = "l60"
"""Machine, equipment and calibration that the loader's model has by itself."""


def baseline(machine_file: Path, recordings: Sequence[Recording]) -> Model:
    """The loader's model of a machine file and the equipment beside it. Raises ConfigurationError."""
    machine = load_machine(machine_file)
    searched = {effect.name: effect for effect in loader.model().effects}
    known = [item for item in machine.effects if item.effect.name in searched]
    others = tuple(item for item in machine.effects if item.effect.name not in searched)
    model = loader.model(recordings, machine=replace(machine, effects=others))
    values: dict[str, dict[str, float]] = {}
    for item in known:
        name = item.effect.name
        kept = {p.name for p in searched[name].parameters}
        values[name] = {
            f"{name}.{p.name}": value / p.si
            for p, value in zip(item.effect.parameters, item.values, strict=True)
            if f"{name}.{p.name}" in kept
        }
    return extended(model, {**values, **_faults(machine_file, model)})


def _faults(machine_file: Path, model: Model) -> Values:
    """What the sensors beside a machine file do beyond the sheet's, as effects of the model."""
    file = companion(machine_file, EQUIPMENT)
    if file is None:
        return {}
    sheet, own = load_equipment(BASE).sensors, load_equipment(file).sensors
    found: dict[str, dict[str, float]] = {}
    for effect in [e for e in model.effects if e.kind == "sensor"]:
        (parameter,) = effect.parameters
        channel, _, kind = parameter.name.rpartition(".")
        old, new = sheet.of(channel), own.of(channel)
        if kind in ("bias", "scale"):
            field = {"bias": "bias", "scale": "scale_error"}[kind]
            value = getattr(new, field) if getattr(new, field) != getattr(old, field) else 0.0
        else:
            value = getattr(new, kind) - getattr(old, kind)
        if value != 0.0:
            found[effect.name] = {parameter.name: value}
    return found


def extended_files(result: Findings, base: Path | None, out: Path) -> Outcome:
    """Machine, equipment and calibration with what was found; base: a machine file that was the baseline."""
    found = [_in_plant_words(item) for item in applied(result)]
    physics = [item for item in found if item.kind == "physics"]
    faults = [item for item in found if item.kind == "sensor"]
    sensors, refused = _sensor_lines(faults)
    calibration, unfollowed = _calibration(found, base)
    said = [
        *not_applied(result),
        *refused,
        *(f"the ECU's calibration does not follow {why}" for why in unfollowed),
    ]
    machine = (base or MACHINES / f"{BASE}.toml").read_text(encoding="utf-8")
    files = {
        out: with_stories(extended_text(machine, physics), found, said),
        named(out, CALIBRATION): calibration,
    }
    equipment = companion(base, EQUIPMENT) if base else None
    if sensors or equipment:
        text = (equipment or FOLDER / f"{BASE}.toml").read_text(encoding="utf-8")
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


def _calibration(found: Sequence[Applied], base: Path | None) -> tuple[str, list[str]]:
    """Text of the ECU's calibration, and a sentence per effect that it does not follow."""
    file = (companion(base, CALIBRATION) if base else None) or CALIBRATIONS / f"{BASE}.toml"
    tables, machine, library = read_toml(file), load_machine(base or BASE), effects()

    def old(key: str) -> float:
        table, _, name = key.partition(".")
        entry = tables[table]
        assert isinstance(entry, dict)
        return float(entry[name])

    before = {item.effect.name for item in machine.effects}
    fresh = [item for item in found if item.effect not in before]
    whole = [
        item
        if item.kind == "sensor"
        else completed(item, {p.name: p.typical for p in library[item.effect].parameters})
        for item in fresh
    ]
    followed = calibrated(whole, old, machine)
    again = [f"{item.effect}: it was made for an earlier value" for item in found if item.effect in before]
    return laid_over(file.read_text(encoding="utf-8"), followed.lines), [*followed.unfollowed, *again]


def _sensor_lines(faults: Sequence[Applied]) -> tuple[list[Line], list[str]]:
    """Sections of the channels' sensors, and the faults that no equipment can have.

    The model knows lag and delay of the sheet and finds what is beyond them; it takes bias and scale as none.
    """
    sheet = load_equipment(BASE).sensors
    lines, refused = [], []
    for item in faults:
        ((name, value),) = item.values.items()
        channel, _, kind = name.rpartition(".")
        key, number = entry(channel, kind, value, sheet.of(channel))
        if kind in ("lag", "delay") and number < 0.0:
            refused.append(
                f"{item.effect} of {value:.4g} s is not applied: the sensor would know the future; is the sheet's delay too long?"
            )
        else:
            lines.append(Line(("sensors", channel), key, number, item.told[name]))
    return lines, refused


def entry(channel: str, kind: str, value: float, sheet: ChannelParameters) -> tuple[str, float]:
    """Key and number of an equipment file for a fault in SI; lag and delay come on top of the sheet's."""
    if kind == "bias":
        unit = FAMILIES[CHANNELS[channel]]
        return f"bias_{unit.suffix}", value / unit.si
    if kind == "scale":
        return "scale_error_percent", 100.0 * value
    return f"{kind}_ms", 1e3 * (getattr(sheet, kind) + value)
