"""What is fitted to a machine and who drives it: sensors, actuators, obedience to limits, driver."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from configuration import Change, CheckedTable, find_file
from plant.unit.actuators import ActuatorParameters, read_actuators
from plant.unit.driver import DriverParameters, read_driver
from plant.unit.limits import Obedience, read_obedience
from plant.unit.sensor_parameters import SensorParameters, read_sensors

FOLDER = Path(__file__).resolve().parents[1] / "equipment_sets"


@dataclass(frozen=True, slots=True, kw_only=True)
class Equipment:
    """Everything between the plant's dynamics and the bus. SI."""

    name: str
    rolling_radius: float  # with which the machine turns wheel speed into ground speed [m]
    sensors: SensorParameters
    actuators: ActuatorParameters
    obedience: Obedience
    driver: DriverParameters


def load_equipment(name_or_path: str | Path, changes: Sequence[Change] = ()) -> Equipment:
    """Equipment by name (a file of plant/equipment_sets/) or by path of a TOML file, `changes` laid over it.

    A file with a key `base` changes the set of that name.
    """
    path = find_file(name_or_path, FOLDER, "equipment")
    table = CheckedTable.from_file(path, changes, bases=FOLDER)
    equipment = Equipment(
        name=path.stem,
        rolling_radius=table.number("rolling_radius_m", unit="m", low=0.1, high=2.0),
        sensors=read_sensors(table.table("sensors"), SensorParameters()),
        actuators=read_actuators(table.table("actuators")),
        obedience=read_obedience(table.table("limits")),
        driver=read_driver(table.table("driver")),
    )
    table.finish()
    return equipment
