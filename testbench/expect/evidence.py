"""What a run left, as expectations look at it."""

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
    """messages, truth: see `RunDirectory`, with frames from before the machine's first tick left out.

    faults: what was injected. duration_s: simulated time that was recorded. limits_stale_s: age of a Limits frame beyond
    which the machine takes its own safe values [s]. frames: of the machine's bus; `Columns.rows` are its rows.
    """

    messages: Mapping[str, Columns]
    truth: Mapping[str, NDArray[np.float64]]
    faults: tuple[Injected, ...]
    duration_s: float
    limits_stale_s: float = 0.05
    frames: FrameTable | None = None

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
    """The frames of the machine's bus, None where there is no log; what is wrong with it is among the run's problems."""
    try:
        return read_candump(run.path / BUS)
    except (LogError, OSError):
        return None


def _from_start(columns: Columns) -> Columns:
    """Without what was on the bus before time zero: an ECU that waits for its machine."""
    kept = columns.time_s >= 0
    if kept.all():
        return columns
    signals = {name: values[kept] for name, values in columns.signals.items()}
    return Columns(codec=columns.codec, time_s=columns.time_s[kept], signals=signals, rows=columns.rows[kept])


def _last(run: RunDirectory) -> float:
    """The last stamp of the bus [s]; of a run that did not end by itself."""
    return max((float(c.time_s[-1]) for c in run.messages.values() if c.time_s.size), default=0.0)
