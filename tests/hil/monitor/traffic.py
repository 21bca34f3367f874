"""Frames of the bench as the monitor meets them: a second of the machine, and of messages made by cantools."""

from functools import cache

from bus.frame import Frame
from dbc import loader_database, reference_database
from hil.monitor.messages import Messages, Selection
from plant.sheets.machine import load_machine
from plant.unit.scenario import load_scenario
from plant.unit.unit import PlantUnit

MS = 1_000_000


@cache
def machine_frames(ticks: int = 100) -> tuple[Frame, ...]:
    """What the machine sends at standstill, stamped with the tick's time."""
    scenario = load_scenario("standstill")
    unit = PlantUnit(load_machine(scenario.machine), scenario, seed=1)
    return tuple(
        frame._replace(at_ns=tick * 10 * MS) for tick in range(ticks) for frame in unit.tick(tick * 10 * MS)
    )


def messages(**selection: object) -> Messages:
    """Our two DBCs, and what is shown of them."""
    return Messages([loader_database(), reference_database()], Selection(**selection))  # type: ignore[arg-type]


def can_id_of(name: str) -> int:
    """Identifier word of a message of loader.dbc."""
    return loader_database().by_name[name].can_id
