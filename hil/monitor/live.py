"""The views of the monitor's table: redrawn in place on a terminal, or printed once at the end."""

import time

from rich.console import Console

from hil.monitor.board import Board
from hil.monitor.messages import Messages
from hil.monitor.source import Batch, Source
from hil.monitor.table import Head, render

# Five times a second: readable values, and little processor time for drawing.
REDRAW_S = 0.2
_ENTER = "\33[?1049h\33[?25l"  # alternate screen, no cursor
_LEAVE = "\33[?25h\33[?1049l"
_HOME, _TO_LINE_END, _TO_SCREEN_END = "\33[H", "\33[K", "\33[J"


class TableView:
    """The table, printed once when the source has ended."""

    def __init__(self, messages: Messages, source: Source, title: str, console: Console) -> None:
        """console: knows the terminal's size and colours; nothing is written by it."""
        self._board = Board(messages)
        self._source, self._title, self._console = source, title, console

    def text(self, batch: Batch) -> str:
        """Nothing yet."""
        take = self._board.take
        for name, frame in batch.frames:
            take(name, frame)
        return ""

    def end(self) -> str:
        """The table in full length."""
        return "".join(f"{line.rstrip()}\n" for line in self._rendered(None).splitlines())

    def _rendered(self, height: int | None) -> str:
        now_ns = self._source.now_ns()
        head = Head(
            source=self._title,
            frames=self._board.frames,
            elapsed_s=self._board.since_ns(now_ns) * 1e-9,
            lost=self._source.lost(),
        )
        with self._console.capture() as captured:
            table = render(head, self._board.rows(now_ns), width=self._console.width, height=height)
            self._console.print(table, no_wrap=True, crop=True)
        return captured.get()


class LiveView(TableView):
    """The table, redrawn in place a few times per second on the terminal's other screen."""

    def __init__(self, messages: Messages, source: Source, title: str, console: Console) -> None:
        super().__init__(messages, source, title, console)
        self._next = 0.0
        self._entered = False

    def text(self, batch: Batch) -> str:
        """The redrawn screen, or '' if the last one is younger than REDRAW_S."""
        super().text(batch)
        if time.monotonic() < self._next:
            return ""
        self._next = time.monotonic() + REDRAW_S
        lines = self._rendered(self._console.height).splitlines()
        enter = "" if self._entered else _ENTER
        self._entered = True
        # each line is overwritten and its rest erased: clearing the whole screen would flicker
        drawn = "\r\n".join(f"{line}{_TO_LINE_END}" for line in lines)
        return f"{enter}{_HOME}{drawn}{_TO_SCREEN_END}"

    def end(self) -> str:
        """Leave the alternate screen and print the last table on the normal one."""
        leave = _LEAVE if self._entered else ""
        return leave + super().end()
