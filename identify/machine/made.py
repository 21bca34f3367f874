"""Bench runs of machines that differ from their sheet by known amounts: truths for tests and measurements of an identification."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from discrepancy.model.description import Model
from discrepancy.models.loader.machine_variant import Variants
from hil.compose import Choice
from hil.runs import run_lockstep
from identify.machine.parameters import PAYLOAD, quantities, sensor_entry
from plant.sheets.machine import load_machine
from plant.unit.equipment import load_equipment

MOST = 2.0  # standard deviations of the prior by which a drawn value differs from the sheet, at most


def drawn(model: Model, random: np.random.Generator, base: str = "l60") -> dict[str, float]:
    """A truth: every shared nuisance of the model from its prior, cut at MOST standard deviations, on a possible machine."""
    variants = Variants(load_machine(base))
    while True:
        found = _drawn(model, random)
        machine = variants.having(found)
        if machine.rear_frame.rigid and machine.front_frame.rigid:
            return found


def _drawn(model: Model, random: np.random.Generator) -> dict[str, float]:
    found = {}
    for p in model.nuisances:
        if p.scope == "all" and p.prior_sd is not None and p.name != PAYLOAD:
            away = float(np.clip(random.normal(), -MOST, MOST))
            found[p.name] = float(np.clip(p.value + away * p.prior_sd, p.lower, p.upper))
    return found


def changes(model: Model, truth: Mapping[str, float], base: str = "l60") -> Iterator[str]:
    """The truth as `--set` changes of a machine and its equipment; parameters that it lacks keep the sheet's value."""
    machine = load_machine(base)
    sheet = load_equipment(machine.family).sensors
    for q in (q for q in quantities(machine, model) if q.parameter in truth):
        value = truth[q.parameter]
        if q.kind == "sensor":
            channel, key, number = sensor_entry(q.parameter, value, sheet)
            yield f"equipment.sensors.{channel}.{key}={number!r}"
        for table, key, quantity in q.keys:
            yield f"machine.{table}.{key}={quantity(value)!r}"


def make_run(
    folder: Path,
    scenario: str,
    seed: int,
    model: Model,
    truth: Mapping[str, float],
    *,
    base: str = "l60",
    more: Sequence[str] = (),
) -> Path:
    """A lockstep run of the bench with the truth's machine and sensors; returns the folder. more: further `--set` changes.

    Raises ConfigurationError for an impossible machine.
    """
    choice = Choice(scenario=scenario, seed=seed, changes=(*changes(model, truth, base), *more))
    run_lockstep(choice, folder)
    return folder
