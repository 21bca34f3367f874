"""A run directory of the bench, read as a recording of the loader's model."""

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np

from bus.user_error import UserError
from dbc import loader_database, reference_database
from dbc.columns import ColumnDecoder, Columns
from dbc.database import Database
from dbc.errors import LogError
from dbc.packing import Signals
from dbc.recordings.reading import read_frames
from dbc.units import factor_to
from discrepancy.models.loader.channels import CHANNELS, INPUTS, LIMITS, OPTIONAL
from discrepancy.signals.recording import Array, Recording, Signal, signal
from plant.unit.signals import MACHINE_MESSAGES, REFERENCE_MESSAGES

TICK_S: Final = 0.01  # of the bus: frames leave within the tick of their sample
THINNED_S: Final = 0.04  # between samples of outputs; the machine's own motions are below 5 Hz, and every row costs time in the fit
HEAVIEST_KG: Final = 20_000.0  # payload, as in a scenario


LIMIT_MESSAGES: Final[Mapping[str, Signals]] = {
    "Limits": {"ArticulationRate": ("rad/s", "articulation_rate_limit")},
    "LinkageLimits": {
        "LiftUpRate": ("rad/s", "lift_up_limit"),
        "LiftDownRate": ("rad/s", "lift_down_limit"),
        "TiltBackRate": ("rad/s", "tilt_back_limit"),
        "TiltForwardRate": ("rad/s", "tilt_forward_limit"),
    },
}
"""The ECU's messages that the model uses: of which unit and name each signal is."""


class DamagedRecord(UserError, ValueError):
    """The record of a run cannot be used; the message names the file, the key and the cause."""


def load_run(folder: Path) -> Recording:
    """A recorded run: bus.log, and reference.log where instruments recorded; stamps are those of the samples.

    A reference.log without a usable frame counts as none. The payload is that of run.json, 0 where there is none; raises DamagedRecord
    where that file cannot be used, dbc's LogError where bus.log cannot.
    """
    signals = _logged(folder / "bus.log", loader_database(), {**MACHINE_MESSAGES, **LIMIT_MESSAGES})
    if (folder / "reference.log").is_file():
        with suppress(LogError):
            signals = _logged(folder / "reference.log", reference_database(), REFERENCE_MESSAGES) | signals
    return Recording(folder.name, signals, _constants(folder / "run.json"))


def _logged(path: Path, database: Database, messages: Mapping[str, Signals]) -> dict[str, Signal]:
    """The model's channels in one log."""
    columns = ColumnDecoder(database).decode(read_frames(path))
    used = [name for name in messages if name in columns]
    first = min((float(columns[name].time_s[0]) for name in used), default=0.0)
    signals: dict[str, Signal] = {}
    for name in used:
        signals = _signals(columns[name], messages[name], first) | signals
    return signals


def _constants(record: Path) -> dict[str, float]:
    """The payload [kg] that the record of the run states; empty without a record. Raises DamagedRecord."""
    if not record.is_file():
        return {}
    try:
        payload = json.loads(record.read_text(encoding="utf-8"))["payload_kg"]
    except (OSError, ValueError, RecursionError) as error:
        raise DamagedRecord(f"{record}: cannot be read as the record of a run: {error}") from error
    except (KeyError, TypeError) as error:
        raise DamagedRecord(f"{record}: has no payload_kg; is it the record of a run?") from error
    if isinstance(payload, bool) or not isinstance(payload, int | float) or not 0.0 <= payload <= HEAVIEST_KG:
        raise DamagedRecord(f"{record}: payload_kg={payload!r} is not a mass from 0 to {HEAVIEST_KG:g} kg")
    return {"payload": float(payload)}


def _signals(found: Columns, wanted: Signals, first: float) -> dict[str, Signal]:
    """The model's channels in one message, SI; stamps are the ticks of the samples, from the first one on."""
    # the bus delays a frame by less than a tick; 0.01 keeps a stamp that rounding has put just below its tick
    time_s = np.floor((found.time_s - first) / TICK_S + 0.01) * TICK_S
    signals = {}
    for label, (unit, source) in wanted.items():
        name = source.replace(" ", "_")
        if not any(name in known for known in (CHANNELS, INPUTS, OPTIONAL, LIMITS)):
            continue
        factor = factor_to(unit, found.codec.by_signal[label].unit)
        values = np.asarray(found.signals[label], float) * factor
        if name in LIMITS:
            # where one is not available the machine has a value of its own, which nobody recorded: the last one stands in for it
            there = np.isfinite(values)
            # obeyed from the machine's next tick on, and until the next limit comes
            signals[name] = signal(time_s[there] + TICK_S, values[there], unit, held=True)
        else:
            kept = thinned(time_s, values) if name in CHANNELS else (time_s, values)
            signals[name] = signal(*kept, unit.replace("s2", "s^2"))
    return signals


def thinned(time_s: Array, values: Array) -> tuple[Array, Array]:
    """One sample every THINNED_S: the mean of two neighbours where they are one tick apart.

    The model interpolates linearly, so that its value at the mean stamp is the mean of two as well: the mean smooths nothing that the
    model does not smooth too.
    """
    slot = np.floor(time_s / THINNED_S + 1e-6)
    first = np.flatnonzero(np.diff(slot, prepend=-np.inf) > 0.0)
    second = np.minimum(first + 1, time_s.size - 1)
    second = np.where(np.abs(time_s[second] - time_s[first] - TICK_S) < 1e-6, second, first)
    return 0.5 * (time_s[first] + time_s[second]), 0.5 * (values[first] + values[second])
