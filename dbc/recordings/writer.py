"""Writes candump logs (`candump -L`): one text line per frame, readable by can-utils, python-can and loaderhil."""

from pathlib import Path

from bus.closing import Closing
from bus.frame import ERROR, EXTENDED, EXTENDED_MASK, FD, REMOTE, Frame

FLUSH_EVERY = 64
"""Frames after which the file is flushed: what a killed process can lose at most."""


def candump_line(frame: Frame, channel: str) -> str:
    """One line without its end; the stamp in seconds with microseconds, as candump writes it."""
    can_id, data, at_ns, flags = frame
    stamp = f"({at_ns // 1_000_000_000:010d}.{at_ns % 1_000_000_000 // 1000:06d}) {channel} "
    if can_id & ERROR:
        identifier = f"{can_id & (EXTENDED_MASK | ERROR):08X}"
    elif can_id & EXTENDED:
        identifier = f"{can_id & EXTENDED_MASK:08X}"
    else:
        identifier = f"{can_id & 0x7FF:03X}"
    if flags & FD:
        return f"{stamp}{identifier}##{flags & 0x3:X}{data.hex().upper()}"
    if can_id & REMOTE:
        return f"{stamp}{identifier}#R{len(data) or ''}"
    return f"{stamp}{identifier}#{data.hex().upper()}"


class CandumpWriter(Closing):
    """A candump log that is complete up to the last flush, whatever ends the process."""

    def __init__(self, path: str | Path) -> None:
        self._file = Path(path).open("w", encoding="ascii", newline="\n")  # noqa: SIM115 - closed by close()
        self._unflushed = 0

    def write(self, frame: Frame, channel: str) -> None:
        """Append one frame as seen on `channel`."""
        self._file.write(f"{candump_line(frame, channel)}\n")
        self._unflushed += 1
        if self._unflushed >= FLUSH_EVERY:
            self.flush()

    def flush(self) -> None:
        """Hand everything written so far to the kernel."""
        self._file.flush()
        self._unflushed = 0

    def close(self) -> None:
        """Flush and close; a second call does nothing."""
        self._file.close()
