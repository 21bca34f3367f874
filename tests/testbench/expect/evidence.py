"""Evidence made of a few samples, for tests that state what an expectation means."""

import numpy as np

from dbc import loader_database
from dbc.columns import Columns
from testbench.expect.evidence import Evidence

PERIOD_S = 0.01


def columns(message, **signals):
    """Frames of a message every 10 ms from time zero, with these values; the other signals are zero."""
    codec = loader_database().by_name[message]
    count = len(next(iter(signals.values())))
    values = {name: np.zeros(count) for name in codec.signals} | {
        name: np.asarray(column, float) for name, column in signals.items()
    }
    return Columns(
        codec=codec, time_s=np.arange(count) * PERIOD_S, signals=values, rows=np.arange(count, dtype=np.int64)
    )


def truth(**fields):
    """Columns of the truth every 10 ms."""
    count = len(next(iter(fields.values())))
    return {"time_s": np.arange(count) * PERIOD_S} | {
        name: np.asarray(column, float) for name, column in fields.items()
    }


def evidence(*messages, true=None, faults=(), duration_s=1.0, frames=None):
    """What a run left: these messages, this truth."""
    return Evidence(
        messages={of.codec.name: of for of in messages},
        truth=true or {},
        faults=tuple(faults),
        duration_s=duration_s,
        frames=frames,
    )
