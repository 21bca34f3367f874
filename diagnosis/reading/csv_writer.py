"""A recording as CSV that `loaderhil diagnose` reads back to the last bit."""

import numpy as np

from discrepancy.signals.recording import Recording


def csv_text(recording: Recording) -> str:
    """One row per stamp of any channel, empty cells where a channel has no sample there; constants in the head.

    A held channel is written at its own stamps, so it reads back as it was.
    """
    signals = recording.signals
    stamps = np.unique(np.concatenate([s.time_s for s in signals.values()]))
    cells = []
    for s in signals.values():
        column = np.full(stamps.size, "", dtype=object)
        column[np.searchsorted(stamps, s.time_s)] = [repr(v) for v in s.value.tolist()]
        cells.append(column)
    head = [f"# {name} = {value!r}" for name, value in recording.constants.items()]
    head.append(",".join(["time [s]", *(f"{name} [{s.unit}]" for name, s in signals.items())]))
    rows = [",".join(row) for row in zip([repr(t) for t in stamps.tolist()], *cells, strict=True)]
    return "\n".join([*head, *rows, ""])
