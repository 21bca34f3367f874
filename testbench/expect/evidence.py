"""The data of a run by which expectations are judged."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from dbc.columns import Columns
from dbc.errors import LogError
from dbc.recordings.logfile import FrameTable, read_candump
from hil.faults.record import Injected, read_faults
from hil.rundir import BUS, RunDirectory


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Recordings of one run, read once for all expectations."""

    messages: Mapping[
        str, Columns
    ]  # decoded frames by message, without those before the machine's first tick
    truth: Mapping[str, NDArray[np.float64]]  # columns of the plant's truth, SI
    faults: tuple[Injected, ...]
    duration_s: float  # simulated time that was recorded [s]
    limits_stale_s: float = (
        0.05  # age of a Limits frame beyond which the machine takes its own safe values [s]
    )
    frames: FrameTable | None = None  # raw frames of the machine's bus; `Columns.rows` are its rows

    @classmethod
    def of(cls, run: RunDirectory, limits_stale_s: float = 0.05) -> Self:
        """The evidence of a run directory."""
        return cls(
            messages={name: _from_start(columns) for name, columns in run.messages.items()},
            truth=run.truth,
            faults=tuple(read_faults(run.path)),
            duration_s=run.record.duration_s or _last(run),
            limits_stale_s=limits_stale_s,
            frames=_frames(run),
        )


def _frames(run: RunDirectory) -> FrameTable | None:
    """The frames of the machine's bus; None without a readable log, which the run's problems then name."""
    try:
        return read_candump(run.path / BUS)
    except (LogError, OSError):
        return None


def _from_start(columns: Columns) -> Columns:
    """The columns without frames before time zero, which an ECU sends while it waits for its machine."""
    # the machine's first sample is time 0 of every file of a run
    kept = columns.time_s >= 0
    if kept.all():
        return columns
    signals = {name: values[kept] for name, values in columns.signals.items()}
    return Columns(codec=columns.codec, time_s=columns.time_s[kept], signals=signals, rows=columns.rows[kept])


def _last(run: RunDirectory) -> float:
    """The last stamp of the bus [s], for a run that was killed: its record says no duration."""
    return max((float(c.time_s[-1]) for c in run.messages.values() if c.time_s.size), default=0.0)
