"""The wheel loader itself, with its whole effect library, led by what was measured.

Inputs are the measured wheel torques and joint angles; the plant's own equations give everything else: wheel speeds,
inertial readings, cylinder pressures, and the wheel forces where test instruments recorded them. A gain draws the speed to
the measured one, so that an error of force shows as a steady difference (plant.follow). What the machine's sheet
does not know exactly (masses, height of the centre of gravity, tyre stiffness, zero points of the sensors) gives way first.
"""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from bus.mistake import Mistake
from dbc import loader_database, reference_database
from dbc.columns import ColumnDecoder, Columns
from dbc.database import Database
from dbc.errors import LogError
from dbc.packing import Signals
from dbc.recording import read_frames
from dbc.units import factor_to
from discrepancy.model import Effect, Model
from discrepancy.models.led import Loader
from discrepancy.models.loader_library import CHANNELS, INPUTS, NUISANCES, OPTIONAL, SPEEDS, library
from discrepancy.models.stretches import LEAD_S, SCORED_S, stretches
from discrepancy.recording import Array, Recording, Signal, signal
from plant.equipment import load_equipment
from plant.interface import MACHINE_MESSAGES, REFERENCE_MESSAGES
from plant.machine import Machine, load_machine

STEP_S: Final = 0.01
FLOOR: Final = 0.2  # one-step errors are at least this share of an error that matters: led by noisy inputs, the plant is wrong by up to that
NEGLIGIBLE: Final = 0.1  # of a typical change: what an engineer would not look for
THINNED_S: Final = 0.04  # between samples of outputs: the machine's own motions are below 5 Hz
HEAVIEST_KG: Final = 20_000.0  # payload, as in a scenario
PILE: Final = "pile_entry.distance_m"
WAYS: Final = (*SPEEDS[:1], *INPUTS, *OPTIONAL)
"""Signals by which ways of driving differ."""


def model(
    recordings: Sequence[Recording] = (), *, machine: Machine | str = "l60", without: tuple[str, ...] = ()
) -> Model:
    """The loader; machine: itself, or name or TOML file, with the sensors of its family; without: effects that are not searched."""
    sheet = load_machine(machine) if isinstance(machine, str) else machine
    equipment = load_equipment(sheet.family)
    lags = {name: equipment.sensors.of(name).lag for name in CHANNELS}
    simulate = Loader(sheet, equipment, recordings)
    return Model(
        name="loader",
        sentence="an articulated wheel loader, led by its measured torques and joint angles",
        inputs=INPUTS,
        optional=OPTIONAL,
        outputs={name: channel.unit for name, channel in CHANNELS.items()},
        nuisances=NUISANCES,
        effects=tuple(_placed(e, simulate) for e in library() if e.name not in without),
        simulate=simulate,
        step_s=STEP_S,
        window_s=SCORED_S,
        lead_s=LEAD_S,
        stretches=lambda recording, interval: stretches(recording, interval, SPEEDS, WAYS),
        slopes_hold=6.0,
        negligible=NEGLIGIBLE,
        floors={name: FLOOR * channel.typical for name, channel in CHANNELS.items()},
        lags={name: lag for name, lag in lags.items() if lag > 0.0},
        least_explained=0.05,
        threads=True,
    )


def _placed(effect: Effect, simulate: Loader) -> Effect:
    """The effect; a pile is first looked for where the recorded machine met something."""
    met = simulate.met_at(STEP_S) if effect.name == "pile_entry" else None
    if met is None:
        return effect
    parameters = [replace(p, value=met - p.typical) if p.name == PILE else p for p in effect.parameters]
    return replace(effect, parameters=tuple(parameters))


def load_run(folder: Path) -> Recording:
    """A recorded run: bus.log, and reference.log where instruments recorded; stamps are those of the samples.

    A reference.log without a usable frame is as none. The payload is that of run.json, 0 where there is none; raises DamagedRecord
    where that file cannot be used, dbc's LogError where bus.log cannot.
    """
    signals = _logged(folder / "bus.log", loader_database(), MACHINE_MESSAGES)
    if (folder / "reference.log").is_file():
        with suppress(LogError):
            signals = _logged(folder / "reference.log", reference_database(), REFERENCE_MESSAGES) | signals
    return Recording(folder.name, signals, _constants(folder / "run.json"))


def _logged(path: Path, database: Database, messages: Mapping[str, Signals]) -> dict[str, Signal]:
    """What the model uses of one log."""
    columns = ColumnDecoder(database).decode(read_frames(path))
    used = [name for name in messages if name in columns]
    first = min((float(columns[name].time_s[0]) for name in used), default=0.0)
    signals: dict[str, Signal] = {}
    for name in used:
        signals = _signals(columns[name], messages[name], first) | signals
    return signals


class DamagedRecord(Mistake, ValueError):
    """The record of a run cannot be used; the message names the file, the key and the cause."""


def _constants(record: Path) -> dict[str, float]:
    """What the record of the run tells of the day: the payload [kg]. Raises DamagedRecord; without a record nothing is known."""
    if not record.is_file():
        return {}
    try:
        payload = json.loads(record.read_text(encoding="utf-8"))["payload_kg"]
    except (OSError, ValueError) as error:
        raise DamagedRecord(f"{record}: cannot be read as the record of a run: {error}") from error
    except (KeyError, TypeError) as error:
        raise DamagedRecord(f"{record}: has no payload_kg; is it the record of a run?") from error
    if isinstance(payload, bool) or not isinstance(payload, int | float) or not 0.0 <= payload <= HEAVIEST_KG:
        raise DamagedRecord(f"{record}: payload_kg={payload!r} is not a mass from 0 to {HEAVIEST_KG:g} kg")
    return {"payload": float(payload)}


def _signals(found: Columns, wanted: Signals, first: float) -> dict[str, Signal]:
    """What the model uses of one message, SI; frames leave within the tick of their sample."""
    time_s = np.floor((found.time_s - first) / STEP_S + 0.01) * STEP_S
    signals = {}
    for label, (unit, source) in wanted.items():
        name = source.replace(" ", "_")
        if name in CHANNELS or name in INPUTS or name in OPTIONAL:
            values = np.asarray(found.signals[label], float) * factor_to(
                unit, found.codec.by_signal[label].unit
            )
            kept = thinned(time_s, values) if name in CHANNELS else (time_s, values)
            signals[name] = signal(*kept, unit.replace("s2", "s^2"))
    return signals


def thinned(time_s: Array, values: Array) -> tuple[Array, Array]:
    """One sample every THINNED_S, the mean of two neighbours where they are a step apart.

    A mean of two lies on the line between them, and so does what a model says of its stamp: nothing is smoothed that the model does not.
    """
    slot = np.floor(time_s / THINNED_S + 1e-6)
    first = np.flatnonzero(np.diff(slot, prepend=-np.inf) > 0.0)
    second = np.minimum(first + 1, time_s.size - 1)
    second = np.where(np.abs(time_s[second] - time_s[first] - STEP_S) < 1e-6, second, first)
    return 0.5 * (time_s[first] + time_s[second]), 0.5 * (values[first] + values[second])
