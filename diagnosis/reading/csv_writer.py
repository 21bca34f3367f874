"""Writes a recording as CSV, for `conceal`; `loaderhil diagnose` reads it back to the last bit."""

import numpy as np

from discrepancy.signals.recording import Recording


def csv_text(recording: Recording) -> str:
    """The text: one row per time stamp of any channel, constants at the head; a channel without a sample in a row has an empty cell."""
    signals = recording.signals
    stamps = np.unique(np.concatenate([s.time_s for s in signals.values()]))
    cells = []
    for s in signals.values():
        # Own stamps only. Filling the gaps of a held channel would change its stamps when it is read back.
        column = np.full(stamps.size, "", dtype=object)
        column[np.searchsorted(stamps, s.time_s)] = [
            repr(v) for v in s.value.tolist()
        ]  # repr: the shortest text that reads back exactly
        cells.append(column)
    head = [f"# {name} = {value!r}" for name, value in recording.constants.items()]
    head.append(",".join(["time [s]", *(f"{name} [{s.unit}]" for name, s in signals.items())]))
    rows = [",".join(row) for row in zip([repr(t) for t in stamps.tolist()], *cells, strict=True)]
    return "\n".join([*head, *rows, ""])
