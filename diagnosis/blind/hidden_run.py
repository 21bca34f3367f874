"""Runs of the bench with hidden effects: what `conceal` makes for the loader, through driver, sensors, CAN encoding and ECU.

The run directory then says nothing of what is hidden: without truth.npz, and without the changes in run.json.
"""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from configuration import ConfigurationError
from diagnosis.apply.machine_files import entry
from diagnosis.blind.hidden import NotHidden, Truth
from hil.compose import Choice
from hil.ending import Ending
from hil.rundir import TRUTH, read_record, write_record
from hil.runs import run_lockstep
from plant.physics.equilibrium import NoEquilibriumError
from plant.plant import DivergedError
from plant.unit.sensor_parameters import SensorParameters

SCENARIO = "loaded"


def concealed_run(scenario: str, truth: Truth, folder: Path) -> None:
    """Run a scenario with the truth's effects. Raises NotHidden where the machine cannot have them; a run cut short is removed."""
    choice = Choice(scenario=scenario, seed=truth.seed)
    words = tuple(_words(truth, choice.load().equipment.sensors))
    try:
        result = run_lockstep(replace(choice, changes=words), folder)
    except (ConfigurationError, DivergedError, NoEquilibriumError) as error:
        raise NotHidden(f"cannot run: {error}") from error
    if result.ending is not Ending.PASSED:
        shutil.rmtree(folder)
        if result.ending is Ending.INTERRUPTED:
            raise KeyboardInterrupt
        raise NotHidden(f"cannot keep the run: {result.reason}")
    (folder / TRUTH).unlink()
    write_record(folder, replace(read_record(folder), changes=()))


def _words(truth: Truth, sheet: SensorParameters) -> Iterator[str]:
    """The effects as changes of the machine and its equipment; a sensor's fault comes on top of what its sheet says."""
    for values in truth.effects.values():
        for name, value in values.items():
            effect, _, parameter = name.partition(".")
            if effect not in sheet.channels:
                yield f"machine.effects.{effect}.{parameter}={value!r}"
                continue
            own = sheet.of(effect)
            more = {"bias": own.bias + value, "scale": (1.0 + own.scale_error) * (1.0 + value) - 1.0}
            key, number = entry(effect, parameter, more.get(parameter, value), own)
            if parameter in ("lag", "delay") and number < 0.0:
                raise NotHidden(f"{name}={value:g} s: the sensor would know the future")
            yield f"equipment.sensors.{effect}.{key}={number!r}"
