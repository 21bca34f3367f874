"""Runs of the bench with hidden effects, for `conceal` with the loader: with driver, sensors, CAN encoding and ECU.

The run directory does not reveal the hidden effects: truth.npz and the changes in run.json are removed.
"""

import shutil
from collections.abc import Iterator, Mapping
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


def concealed_run(choice: Choice, truth: Truth, folder: Path) -> None:
    """Run a choice with the truth's seed and effects. Raises NotHidden where the machine cannot have them; an incomplete run is removed."""
    run_with_effects(replace(choice, seed=truth.seed), truth.effects, folder)


def run_with_effects(choice: Choice, effects: Mapping[str, Mapping[str, float]], folder: Path) -> None:
    """Run a choice with parameters by effect. Raises NotHidden where the machine cannot have them; an incomplete run is removed."""
    changes = tuple(_changes(effects, choice.load().equipment.sensors))
    try:
        result = run_lockstep(replace(choice, changes=(*choice.changes, *changes)), folder)
    except (ConfigurationError, DivergedError, NoEquilibriumError) as error:
        raise NotHidden(f"cannot run: {error}") from error
    if result.ending is not Ending.PASSED:
        shutil.rmtree(folder)
        if (
            result.ending is Ending.INTERRUPTED
        ):  # the run caught Ctrl-C to end cleanly; the command must end as well
            raise KeyboardInterrupt
        raise NotHidden(f"cannot keep the run: {result.reason}")
    (folder / TRUTH).unlink()
    write_record(folder, replace(read_record(folder), changes=choice.changes))


def _changes(effects: Mapping[str, Mapping[str, float]], sheet: SensorParameters) -> Iterator[str]:
    """The effects as `--set` changes of the machine and its equipment; a sensor fault is added to the errors in its sheet."""
    for values in effects.values():
        for name, value in values.items():
            effect, _, parameter = name.partition(".")
            if effect not in sheet.channels:
                yield f"machine.effects.{effect}.{parameter}={value!r}"
                continue
            own = sheet.of(effect)
            # scale errors multiply: (1 + old)(1 + new) - 1; the sheet's bias, lag and delay simply add
            more = {"bias": own.bias + value, "scale": (1.0 + own.scale_error) * (1.0 + value) - 1.0}
            key, number = entry(effect, parameter, more.get(parameter, value), own)
            if parameter in ("lag", "delay") and number < 0.0:
                raise NotHidden(
                    f"{name}={value:g} s: the total delay would be negative, so the sensor would report the future"
                )
            yield f"equipment.sensors.{effect}.{key}={number!r}"
