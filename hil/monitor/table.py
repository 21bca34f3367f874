"""Lays out the rows of a board as a table for a terminal of a given size."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hil.monitor.board import Pace, Row
from hil.monitor.messages import ABSENT

_COLOUR = {
    Pace.NONE: "",
    Pace.FAST: "yellow",
    Pace.SLOW: "yellow",
    Pace.LATE: "yellow",
    Pace.STALE: "red",
    Pace.MISSING: "red",
}
Column = tuple[str, Callable[[Row], str]]
_PERIOD, _AGE = "ms/cycle", "age s"
_STEADY = {_PERIOD: 9, _AGE: 5, "": 5}
"""Least widths of these columns, so that the table does not move while its content changes."""
_HEAD_LINES = 2
_GAP = 1
_BETWEEN = 2
_LEAST_SIGNALS = 16
"""Least width of the column of signals."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """The line above the table."""

    source: str
    frames: int  # so far
    elapsed_s: float  # since the first frame [s]
    lost: dict[str, int] = field(default_factory=dict)  # frames by bus


def render(head: Head, rows: Sequence[Row], *, width: int, height: int | None) -> RenderableType:
    """Head, as many rows as there is room for, and how many there are beyond; height None: all, unshortened."""
    several = len({row.bus for row in rows}) > 1
    columns = _columns(several)
    cells = [[text(row) for _, text in columns] for row in rows]
    widths = [
        max([len(title), _STEADY.get(title, 0), *(len(line[index]) for line in cells)])
        for index, (title, _) in enumerate(columns)
    ]
    room = max(_LEAST_SIGNALS, width - sum(widths) - _GAP * len(widths))
    signals = [_wrapped(_signals(row, room), room) for row in rows]
    heights = _heights([len(lines) for lines in signals], height)
    table = Table(box=None, pad_edge=False, padding=(0, _GAP, 0, 0), header_style="bold", width=width)
    for index, (title, _) in enumerate(columns):
        to_the_right = title in (_PERIOD, _AGE)
        table.add_column(
            title, justify="right" if to_the_right else "left", no_wrap=True, width=widths[index]
        )
    table.add_column("signals", no_wrap=True, width=room)
    for row, line, wrapped, lines in zip(rows, cells, signals, heights, strict=False):
        table.add_row(*line, _cut(wrapped, lines, room), style=_COLOUR[row.pace])
    hidden = len(rows) - len(heights)
    below = (
        [Text(f"and {hidden} more; narrow it down with --message, --sender or --signals", "dim")]
        if hidden
        else []
    )
    return Group(_headline(head, width), table, *below)


def _columns(several: bool) -> list[Column]:
    """Titles, and what stands below them."""
    columns: list[Column] = [
        ("message", lambda row: row.name or "not in any DBC"),
        ("id", lambda row: row.identifier),
        (_PERIOD, _period),
        (_AGE, lambda row: "" if row.age_ns is None else f"{row.age_ns * 1e-9:.2f}"),
        ("", lambda row: row.pace.value),
    ]
    return [("bus", lambda row: row.bus), *columns] if several else columns


def _period(row: Row) -> str:
    """Measured of expected, in milliseconds."""
    measured = "" if row.period_ns is None else f"{row.period_ns * 1e-6:.1f}"
    return f"{measured or '-'}/{row.cycle_ns * 1e-6:g}" if row.cycle_ns else measured


def _headline(head: Head, width: int) -> Text:
    """Source, how much has come, and what was lost; cut to one line."""
    rate = head.frames / head.elapsed_s if head.elapsed_s > 0 else 0.0
    text = Text(no_wrap=True, overflow="ellipsis")
    text.append(head.source, "bold")
    text.append(f"  {head.frames} frames, {rate:.0f}/s, {head.elapsed_s:.1f} s")
    lost = {bus: count for bus, count in head.lost.items() if count}
    if lost:
        text.append(
            "  fell behind, lost: " + ", ".join(f"{bus} {count}" for bus, count in lost.items()), "bold red"
        )
    text.truncate(width)
    return text


def _signals(row: Row, width: int) -> list[Text]:
    """Findings, then readings, as pieces that are not broken across lines.

    Where a reading is longer than `width`, the name of the signal is shortened, not its value.
    """
    pieces = []
    for shown, value in row.readings:
        value_text = shown.text(value)
        if (deviation := row.deviations.get(shown.name)) and not shown.label(value):
            value_text += f" ± {deviation}"
        piece = Text(shown.name)
        piece.truncate(max(1, width - len(value_text) - 1), overflow="ellipsis")
        piece.append(" ")
        piece.append(value_text, "dim" if value_text == ABSENT else "bold")
        pieces.append(piece)
    if row.findings:
        pieces.insert(0, Text(f"{row.findings} bad: {row.note}", "red"))
    elif row.note:
        pieces.append(Text(row.note))
    return pieces


def _wrapped(pieces: Sequence[Text], width: int) -> list[Text]:
    """The pieces in lines of at most `width`; a piece that is longer has a line of its own."""
    lines: list[Text] = [Text()]
    for piece in pieces:
        if lines[-1] and len(lines[-1]) + _BETWEEN + len(piece) > width:
            lines.append(Text())
        if lines[-1]:
            lines[-1].append(" " * _BETWEEN)
        lines[-1].append_text(piece)
    return lines


def _heights(wanted: Sequence[int], height: int | None) -> list[int]:
    """Lines of each row: one, and more while there is room, first rows first; [] without any room."""
    if height is None:
        return list(wanted)
    room = height - _HEAD_LINES
    if len(wanted) > room:
        return [1] * max(0, room - 1)  # one line says how many are not shown
    heights, spare = [], room - len(wanted)
    for lines in wanted:
        more = min(lines - 1, spare)
        spare -= more
        heights.append(1 + more)
    return heights


def _cut(lines: Sequence[Text], count: int, width: int) -> Text:
    """The first lines; what does not fit is marked by an ellipsis."""
    shown = [line.copy() for line in lines[:count]]
    if len(lines) > count:
        shown[-1].append(" \u2026")
    for line in shown:
        line.truncate(width, overflow="ellipsis")
    return Text("\n").join(shown)
