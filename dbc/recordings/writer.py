"""Writes candump logs (`candump -L`): one text line per frame, readable by can-utils, python-can and loaderhil."""

from pathlib import Path
from typing import TYPE_CHECKING

from bus.closing import Closing
from bus.frame import ERROR, EXTENDED, EXTENDED_MASK, FD, REMOTE, Frame

if TYPE_CHECKING:  # a recorder in real time has no room for numpy
    from bus.rows import Frames

FLUSH_NS = 100_000_000
"""Time between stamps after which the file is flushed [ns]: half of the 0.2 s that a kill may lose. By time and not by frames,
because 64 frames of a quiet bus are many seconds."""


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
    """A candump log that is complete up to the last flush, whatever ends the process.

    Frames that wait when a bus falls silent go with the next frame; who waits for a silent bus calls `flush`.
    """

    def __init__(self, path: str | Path) -> None:
        self._file = Path(path).open("w", encoding="ascii", newline="\n")  # noqa: SIM115 - closed by close()
        self._flushed_ns: int | None = None

    def write(self, frame: Frame, channel: str) -> None:
        """Append one frame as seen on `channel`."""
        self._file.write(f"{candump_line(frame, channel)}\n")
        if self._flushed_ns is None:
            self._flushed_ns = frame.at_ns
        # either way: stamps of another clock, or of a machine that starts anew, may lie before
        elif abs(frame.at_ns - self._flushed_ns) >= FLUSH_NS:
            self._flushed_ns = frame.at_ns
            self.flush()

    def write_all(self, frames: "Frames", channel: str) -> None:
        """Append frames as they are kept, by rows many times as fast as one by one, and flush them."""
        # late, as above
        from dbc.recordings.candump_rows import lines_of

        made, tables = frames.parts()
        for frame in made:
            self.write(frame, channel)
        for table in tables:
            self._file.write(lines_of(table, channel))
        self.flush()

    def flush(self) -> None:
        """Hand everything written so far to the kernel."""
        self._file.flush()

    def close(self) -> None:
        """Flush and close; a second call does nothing."""
        self._file.close()
