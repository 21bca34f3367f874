"""`monitor --raw`: frames in candump's format, to standard output or into a log file with candump's name."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Self

from hil.monitor.candump import Candump, Style
from hil.monitor.source import Batch, Source


class RawView:
    """Text of the frames; `drops`: lost frames are reported between the lines, as `candump -d` does."""

    def __init__(self, style: Style, source: Source, *, drops: bool = False) -> None:
        self._candump = Candump(style, source.names)
        self._source, self._drops = source, drops
        self._lost: dict[str, int] = {}

    def text(self, batch: Batch) -> str:
        """The batch's lines, each with its end."""
        line, ahead_ns = self._candump.line, batch.ahead_ns
        lines = self._drop_lines() if self._drops else []
        lines += [line(name, frame, frame.at_ns + ahead_ns) for name, frame in batch.frames]
        return "\n".join([*lines, ""])

    def end(self) -> str:
        """Nothing."""
        return ""

    def _drop_lines(self) -> list[str]:
        lines = []
        for name, total in self._source.lost().items():
            count = total - self._lost.get(name, 0)
            if count:
                plural = "s" if count > 1 else ""
                lines.append(
                    f"DROPCOUNT: dropped {count} CAN frame{plural} on '{name}' socket (total drops {total})"
                )
            self._lost[name] = total
        return lines


class LogFile:
    """`-l`: the frames into a new log in this folder, nothing on standard output."""

    def __init__(self, style: Style, source: Source, folder: Path = Path()) -> None:
        """The file has candump's name, with the local time; FileExistsError rather than one overwritten."""
        self.path = folder / time.strftime("candump-%Y-%m-%d_%H%M%S.log")
        self._lines = RawView(replace(style, log=True), source)
        self._file = self.path.open("x", encoding="ascii", newline="\n")

    def text(self, batch: Batch) -> str:
        """Write the batch's lines into the file, whole; '' for standard output."""
        self._file.write(self._lines.text(batch))
        self._file.flush()
        return ""

    def end(self) -> str:
        """Nothing."""
        return ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
