"""Scenarios: a drive case as a small, validated TOML file."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

from configuration import Change, CheckedTable, find_file
from plant.physics.surface import Surface
from plant.sheets.changes import UNCHANGED, Changes
from plant.sheets.machine import family_of
from plant.unit.equipment import Equipment, load_equipment
from plant.unit.script import DEGREE, KMH, Script, read_script
from plant.unit.sensor_parameters import read_sensors

FOLDER = Path(__file__).resolve().parents[1] / "scenarios"


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Pose and motion at the start, SI. None: the machine's carry position."""

    speed: float = 0.0
    articulation_angle: float = 0.0
    lift_arm_angle: float | None = None
    tilt_angle: float | None = None
    heading: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A drive case: which machine, on what ground, from where, and what its driver does. SI."""

    path: Path
    name: str
    sentence: str
    duration_s: float
    machine: str  # name or path for plant.sheets.machine.load_machine
    payload_mass: float
    surface: Surface
    start: Start
    script: Script
    equipment: Equipment
    seed: int
    changes: Changes = UNCHANGED
    """What was laid over the files; that of the machine is still to be done when it is loaded."""


def list_scenarios() -> list[Scenario]:
    """The shipped scenarios in the order of their names."""
    return [load_scenario(path) for path in sorted(FOLDER.glob("*.toml"))]


def load_scenario(name_or_path: str | Path, changes: Changes = UNCHANGED) -> Scenario:
    """A scenario by name (a file of plant/scenarios/) or by path of a TOML file, `changes` laid over it.

    Raises ConfigurationError, which names file, key, value, unit and permitted range.
    """
    path = find_file(name_or_path, FOLDER, "scenario")
    table = CheckedTable.from_file(path, changes.scenario)
    name = table.text("name")
    if name != path.stem:
        raise table.error("name", f"= {name!r} is not the name of the file, {path.stem!r}")
    machine = table.text("machine")
    changes = changes.of_machine(_read_effects(table))
    fitted = table.text("equipment") if "equipment" in table else family_of(machine, changes.machine)
    equipment = load_equipment(fitted, changes.equipment)
    scenario = Scenario(
        path=path,
        name=name,
        sentence=table.text("sentence"),
        duration_s=table.number("duration_s", unit="s", low=0.1, high=3600.0),
        machine=machine,
        payload_mass=table.number("payload_kg", unit="kg", low=0.0, high=20_000.0, default=0.0),
        surface=_read_surface(table.table("surface")),
        start=_read_start(table.table("start")),
        script=read_script(table.table("driver")),
        equipment=replace(equipment, sensors=read_sensors(table.table("sensors"), equipment.sensors)),
        seed=table.integer("seed", low=0, high=2**32 - 1, default=0),
        changes=changes,
    )
    table.tables("fault")  # the bench's own, which reads them with the DBC at hand
    table.tables("expect")  # likewise
    table.finish()
    return scenario


def _read_effects(table: CheckedTable) -> list[Change]:
    """The [effects.NAME] tables as changes of the machine, which checks them: a pile, a kerb, soft ground."""
    effects = table.table("effects")
    return [(("effects", name), effects.table(name).values) for name in effects.keys()]  # noqa: SIM118


def _read_surface(table: CheckedTable) -> Surface:
    surface = Surface(
        friction=table.number("friction", unit="1", low=0.05, high=1.2, default=0.75),
        grade=math.atan(table.number("grade_percent", unit="%", low=-100.0, high=100.0, default=0.0) / 100),
        bank=table.number("bank_deg", unit="deg", low=-30.0, high=30.0, default=0.0) * DEGREE,
    )
    table.finish()
    return surface


def _read_start(table: CheckedTable) -> Start:
    def pose(key: str) -> float | None:
        return table.number(key, unit="deg", low=-90.0, high=90.0) * DEGREE if key in table else None

    start = Start(
        speed=table.number("speed_kmh", unit="km/h", low=-20.0, high=40.0, default=0.0) * KMH,
        articulation_angle=table.number("articulation_deg", unit="deg", low=-40.0, high=40.0, default=0.0)
        * DEGREE,
        lift_arm_angle=pose("lift_arm_deg"),
        tilt_angle=pose("tilt_deg"),
        heading=table.number("heading_deg", unit="deg", low=-180.0, high=180.0, default=0.0) * DEGREE,
    )
    table.finish()
    return start
