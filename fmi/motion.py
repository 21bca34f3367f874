"""An FMU in the place of the plant: the bench's driver, limits, sensors and bus stay, the motion is the FMU's.

By name, or by the [plant] table of the companion file, commands go to the FMU's inputs and its outputs become parts of the truth, which
the sensors read. What the sensors read must all be given; what else the truth has, and the FMU has not, is not a number.
"""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from configuration import CheckedTable
from discrepancy.signals.units import parse_unit
from fmi.archive import FmuError
from fmi.companion import closest
from fmi.description import Description, Variable, read_description
from fmi.instance import Instance, StepError
from fmi.quantities import COMMANDS, PLACES, TRUTH, numbers_of
from plant.plant import Commands, DivergedError
from plant.truth import Truth
from plant.unit.signals import CHANNELS

Floats = np.ndarray[tuple[int], np.dtype[np.float64]]

_FELT, _FORCE = Truth.inclination.at, Truth.imu_specific_force.at


@dataclass(frozen=True, slots=True)
class Connections:
    """How an FMU is connected to the bench."""

    inputs: Mapping[str, str]  # input of the FMU -> command
    outputs: Mapping[str, str]  # quantity of the truth -> output of the FMU
    constants: Mapping[str, float]  # quantity of the truth -> value [SI]
    values: Mapping[str, float]  # start value of a parameter of the FMU, in its unit


class FmuMotion:
    """What PlantUnit needs of its dynamics, by an FMU."""

    def __init__(self, description: Description, connections: Connections) -> None:
        """Raises FmuError for a unit of another quantity than the command's or the sensor's."""
        known = description.variables
        inputs = [known[name] for name in connections.inputs]
        outputs = [known[name] for name in connections.outputs.values()]
        for variable, name in zip(inputs, connections.inputs.values(), strict=True):
            _check_unit(description, variable, name, COMMANDS[name])
        names = list(TRUTH)
        for variable, name in zip(outputs, connections.outputs, strict=True):
            _check_unit(description, variable, name, TRUTH[names[PLACES[name]]])
        order = list(COMMANDS)
        self._from = [order.index(name) for name in connections.inputs.values()]
        self._to, self._which = _filled(list(connections.outputs))
        self._inputs, self._outputs = inputs, outputs
        self._row = np.full(Truth.size, math.nan)
        for place, which in zip(*_filled(list(connections.constants)), strict=True):
            self._row[place] = list(connections.constants.values())[which]
        self._ticks, self._time_s = 0, 0.0
        self._instance = Instance(description, inputs, outputs)
        starts = [(known[name], value) for name, value in connections.values.items()]
        self._instance.start(starts, np.array([v.start or 0.0 for v in inputs]))
        self._read: Floats = np.empty(len(outputs))

    def advance(self, commands: Commands, duration_s: float) -> Truth:
        """Move on with constant commands; returns everything that the FMU gives then. Raises DivergedError where the FMU fails."""
        numbers = numbers_of(commands)
        given = [v.from_si(numbers[at]) for v, at in zip(self._inputs, self._from, strict=True)]
        try:
            self._instance.set_inputs(np.array(given))
            self._instance.step(self._ticks * duration_s, duration_s)
        except StepError as error:
            raise DivergedError(str(error)) from error
        self._ticks += 1
        self._time_s = self._ticks * duration_s
        return self.truth()

    def truth(self) -> Truth:
        """Everything that the FMU gives now."""
        self._instance.get_outputs(self._read)
        row = self._row.copy()
        values = [v.to_si(x) for v, x in zip(self._outputs, self._read.tolist(), strict=True)]
        row[self._to] = [values[which] for which in self._which]
        row[Truth.time_s.at] = self._time_s
        felt = row[_FELT : _FELT + 2]
        # few simulators know what an inclination sensor takes for the slope; it follows from what they all give
        felt[np.isnan(felt)] = _inclination(*row[_FORCE : _FORCE + 3].tolist())[np.isnan(felt)]
        return Truth(row)


def _inclination(ahead: float, aside: float, up: float) -> Floats:
    """Pitch and roll (2,) [rad] that accelerometers take for the slope, from the specific force [m/s2]."""
    return np.array([math.atan2(-ahead, math.hypot(aside, up)), math.atan2(aside, up)])


def _filled(names: Sequence[str]) -> tuple[list[int], list[int]]:
    """Places in a row that these names fill, each with the number of its name.

    A sensor may bear the name of a number of the truth and read another one (wheel torque: what is known of it). Such a name fills
    both; a name that means one place alone comes last and so decides there.
    """
    own = {name: place for place, name in enumerate(TRUTH)}
    both = [(PLACES[name], k) for k, name in enumerate(names) if own.get(name, PLACES[name]) != PLACES[name]]
    filled = [*both, *((own.get(name, PLACES[name]), k) for k, name in enumerate(names))]
    return [place for place, _ in filled], [k for _, k in filled]


def motion_of(file: Path) -> FmuMotion:
    """The FMU as motion, connected by names and by the [plant] table of FILE.toml beside it. Raises FmuError or ConfigurationError."""
    description = read_description(file)
    beside = file.with_suffix(".toml")
    return FmuMotion(description, connected(description, beside if beside.is_file() else None))


def fingerprint(file: Path) -> str:
    """Name and digest of an FMU, for the record of a run."""
    return f"{file.name} sha256 {hashlib.sha256(file.read_bytes()).hexdigest()[:16]}"


def connected(description: Description, companion: Path | None) -> Connections:
    """The connections by equal names, changed by the companion. Raises FmuError where a sensor would read nothing."""
    top = CheckedTable({}, file="") if companion is None else CheckedTable.from_file(companion)
    table = top.table("plant")
    offered = {v.name for v in description.named("input")}, {v.name for v in description.named("output")}
    inputs = {name: name for name in COMMANDS if name in offered[0]}
    for name in (given := table.table("inputs")).keys():  # noqa: SIM118
        _known(given, name, name, offered[0])
        inputs[name] = given.text(name)
        _known(given, name, inputs[name], set(COMMANDS))
    outputs = {name: name for name in PLACES if name in offered[1]}
    for name in (given := table.table("outputs")).keys():  # noqa: SIM118
        _known(given, name, name, set(PLACES))
        outputs[name] = given.text(name)
        _known(given, name, outputs[name], offered[1])
    constants = {}
    for name in (given := table.table("constants")).keys():  # noqa: SIM118
        _known(given, name, name, set(PLACES))
        constants[name] = given.number(name, unit=list(TRUTH.values())[PLACES[name]])
    values = {}
    for name in (given := table.table("values")).keys():  # noqa: SIM118
        settable = {v.name for v in description.variables.values() if v.settable}
        _known(given, name, name, settable)
        values[name] = given.number(name, unit=description.variables[name].unit or "1")
    table.finish()
    there = {PLACES[name] for name in (*outputs, *constants)}
    if missing := [name for name in CHANNELS if PLACES[name] not in there]:
        raise FmuError(
            f"{description.file}: nothing gives what these sensors read: {', '.join(missing)}; name an output in [plant.outputs] "
            f"or a number in [plant.constants] of {description.file.with_suffix('.toml').name}"
        )
    return Connections(inputs, outputs, constants, values)


def _known(table: CheckedTable, key: str, name: str, known: set[str]) -> None:
    if name in known:
        return
    raise table.error(key, f"names {name!r}, which does not exist; {closest(name, sorted(known))}")


def _check_unit(description: Description, variable: Variable, name: str, unit: str) -> None:
    """Raises FmuError where the FMU states another quantity; a variable without a unit is taken as SI."""
    if variable.unit and not parse_unit(variable.si).same_quantity(parse_unit(unit)):
        raise FmuError(f"{description.file}: {variable.name} is in {variable.unit}, {name} is in {unit}")
