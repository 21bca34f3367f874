"""The composition root of the bench: builds the plant unit, the ECU cycle and the run's record from the user's choice.

Besides the command line, only this module of the bench imports both plant and ECU.
"""

import datetime
import importlib.metadata
import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bus.user_error import UserError
from configuration import find_file
from dbc import loader_database
from ecu.calibration import load_calibration
from ecu.core import PYTHON, Core, Ecu, Form
from hil.companions import CALIBRATION as CALIBRATION_FILE
from hil.companions import EQUIPMENT, companion
from hil.ecu_side import ecu_cycle
from hil.faults.injector import Injector
from hil.faults.restartable import RestartableEcu, RestartablePlant, acting_on
from hil.faults.table import faults_of
from hil.faults.wire import FaultyWire
from hil.lockstep import Lockstep
from hil.rundir import Mode, RunRecord
from plant.plant import Plant
from plant.sheets.changes import Changes
from plant.sheets.machine import Machine, load_machine
from plant.truth import Truth, columns_of
from plant.unit.actuators import Four, four
from plant.unit.scenario import FOLDER, Scenario, load_scenario
from plant.unit.unit import PlantUnit


class ChoiceError(UserError, ValueError):
    """The user's choice cannot be run; the message names the option and the permitted values."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """The run that the user chose. None takes the scenario's own value."""

    scenario: str  # name of a shipped one, or path of a TOML file
    form: Form = "corrected"  # equations of the ECU's estimators
    limits: bool = True  # whether the ECU limits the machine
    detect_faults: bool = True  # whether the ECU tests its sensors against each other
    payload_kg: float | None = None
    seed: int | None = None
    inject: Path | None = None  # TOML file with additional faults
    expect: Path | None = None  # TOML file with additional expectations
    changes: tuple[str, ...] = ()  # KEY=VALUE, override the files of scenario, machine and equipment
    calibration: str | None = None  # of the ECU, a name or file; None: that of the machine's family
    fmu: Path | None = None  # FMU that moves in place of our plant
    core: Core = PYTHON  # what computes the ECU; deploy.c.core.C is the exported C

    def on(self, machine: str) -> "Choice":
        """The same on another machine, with the equipment and the calibration that lie beside its file."""
        file = Path(machine)
        equipment, calibration = companion(file, EQUIPMENT), companion(file, CALIBRATION_FILE)
        words = [
            f"machine={json.dumps(machine)}",
            *([f"equipment={json.dumps(str(equipment))}"] if equipment else []),
        ]
        return replace(
            self,
            changes=(*words, *self.changes),
            calibration=str(calibration) if calibration else self.calibration,
        )

    def load(self) -> Scenario:
        """The scenario with the choices applied. Also checks the calibration, so that an error comes before the run starts."""
        scenario = load_scenario(_named(self.scenario), Changes.of(self.changes))
        load_calibration(calibration_of(scenario, self.calibration))
        if self.payload_kg is not None:
            if not 0 <= self.payload_kg <= 20_000:
                raise ChoiceError(f"--payload-kg {self.payload_kg:g} kg is outside 0 .. 20000 kg")
            scenario = replace(scenario, payload_mass=self.payload_kg)
        return scenario if self.seed is None else replace(scenario, seed=self.seed)

    def injector(self) -> Injector | None:
        """The faults of the scenario, then those of `inject`, drawn from the seed; None if there are none."""
        database = loader_database()
        faults = tuple(
            fault
            for file in self.fault_files()
            for fault in faults_of(file, database, alone=file == self.inject)
        )
        return Injector(database, faults, seed=self.load().seed) if faults else None

    def expectation_files(self) -> list[Path]:
        """The files that may hold expectations: the scenario's, and `expect`."""
        scenario = find_file(_named(self.scenario), FOLDER, "scenario")
        return [scenario] if self.expect is None else [scenario, self.expect]

    def fault_files(self) -> list[Path]:
        """The files that may hold faults: the scenario's, and `inject`."""
        scenario = find_file(_named(self.scenario), FOLDER, "scenario")
        return [scenario] if self.inject is None else [scenario, self.inject]

    def arguments(self) -> list[str]:
        """The same choice as command-line arguments of `loaderhil plant`."""
        words = [self.scenario]
        if self.payload_kg is not None:
            words += ["--payload-kg", repr(self.payload_kg)]
        if self.seed is not None:
            words += ["--seed", str(self.seed)]
        for change in self.changes:
            words += ["--set", change]
        if self.fmu is not None:
            words += ["--fmu", str(self.fmu)]
        return words

    def record(self, scenario: Scenario, mode: Mode) -> RunRecord:
        """The record of a run that starts now. scenario: as loaded, perhaps changed since."""
        found = versions()
        calibration = calibration_of(scenario, self.calibration)
        if self.fmu is not None:
            from fmi.motion import fingerprint  # late: only a run with an FMU needs what reads one

            found["plant"] = fingerprint(self.fmu)
        return RunRecord(
            scenario=scenario.name,
            machine=scenario.machine,
            mode=mode,
            form=self.form,
            limits=self.limits,
            detect_faults=self.detect_faults,
            ecu_core=self.core.computing(load_calibration(calibration), self.form),
            calibration=calibration,
            seed=scenario.seed,
            payload_kg=float(scenario.payload_mass),
            changes=scenario.changes.words,
            started=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            versions=found,
            standing_load_n=standing_loads(scenario),
        )


def _named(scenario: str) -> str | Path:
    return Path(scenario) if scenario.endswith(".toml") else scenario


def machine_of(scenario: Scenario) -> Machine:
    """The machine of a scenario, with its changes."""
    return load_machine(scenario.machine, scenario.changes.machine)


def calibration_of(scenario: Scenario, chosen: str | None = None) -> str:
    """The ECU's calibration: the chosen one, else that of the family of the scenario's machine."""
    machine = machine_of(scenario)
    return machine.family if chosen is None else chosen


def standing_loads(scenario: Scenario) -> Four:
    """What each wheel carries [N] while the scenario's machine, laden and posed as at its start, stands straight on level ground."""
    start = scenario.start
    at_rest = Plant(
        machine_of(scenario),
        payload_mass=scenario.payload_mass,
        lift_arm_angle=start.lift_arm_angle,
        tilt_angle=start.tilt_angle,
    )
    return four(at_rest.truth().normal_force.tolist())


def plant_unit(scenario: Scenario, fmu: Path | None = None) -> PlantUnit:
    """The machine of a scenario, in equilibrium and ready for its first tick. fmu: what moves in its place."""
    motion = None
    if fmu is not None:
        from fmi.motion import motion_of

        motion = motion_of(fmu)
    return PlantUnit(machine_of(scenario), scenario, seed=scenario.seed, motion=motion)


def lockstep(
    scenario: Scenario,
    *,
    form: Form = "corrected",
    limits: bool = True,
    reference: bool = True,
    injector: Injector | None = None,
    calibration: str | None = None,
    detect_faults: bool = False,
    core: Core = PYTHON,
    fmu: Path | None = None,
) -> Lockstep:
    """Plant and ECU on one virtual clock.

    reference: record the frames of the test instrumentation too; detect_faults: the ECU tests its sensors against each other;
    core: what computes the ECU; fmu: what moves in place of our plant.
    """
    fitting = calibration_of(scenario, calibration)

    # a fault may kill the ECU; its restart needs a new one without any state
    def fresh() -> Ecu:
        return ecu_cycle(
            form=form, limits=limits, calibration=fitting, detect_faults=detect_faults, core=core
        )

    if injector is None:
        return Lockstep(plant_unit(scenario, fmu), fresh(), reference=reference)
    plant, ecu = RestartablePlant(plant_unit(scenario, fmu)), RestartableEcu(fresh)
    injector.start(0)
    wire = FaultyWire(injector, acting_on(plant, ecu))
    return Lockstep(plant, ecu, wire=wire, reference=reference)


def truth_columns(truth: Sequence[Truth]) -> dict[str, NDArray[np.float64]]:
    """The truth of a run as one array per field, first axis time."""
    return columns_of(np.array([moment.row for moment in truth]).reshape(-1, Truth.size))


def versions() -> dict[str, str]:
    """Versions of the packages on which the result of a run depends."""
    packages = ("loaderhil", "numpy", "numba", "python-can")
    return {"python": platform.python_version()} | {
        name: importlib.metadata.version(name) for name in packages
    }
