"""Formats deadline verdicts as a table for the terminal, for `check` and the summary of `run`."""

from collections.abc import Sequence

from rich.table import Table

from hil.timing.deadlines import Judged
from hil.verdict import Result

COLOUR = {Result.PASSED: "green", Result.FAILED: "red", Result.INCONCLUSIVE: "yellow"}


def table_of(messages: Sequence[Judged], *, channels: bool) -> Table:
    """One row per message; channels: whether their channel is named."""
    table = Table(box=None, header_style="bold")
    for name in (*(["channel"] if channels else []), "message"):
        table.add_column(name, no_wrap=True)
    for count in (
        "T \\[ms]",
        "frames",
        "missing",
        "late",
        "early",
        "repeated",
        "jumps",
        "stale",
        "worst \\[ms]",
    ):
        table.add_column(count)
    table.add_column("", no_wrap=True)
    for one in messages:
        v = one.verdict
        colour = COLOUR[v.result]
        worst = "–" if v.worst_gap_ns is None else f"{v.worst_gap_ns * 1e-6:.1f}"
        table.add_row(
            *([one.channel] if channels else []), v.name, f"{(v.period_ns or 0) * 1e-6:g}", str(v.frames),
            *(str(count or "–") for count in (v.missing, v.late, v.early, v.duplicates, v.counter_jumps)),
            f"{100 * v.stale_share:.1f} %" if v.stale_share else "–", worst,
            f"[{colour}]{v.result.value}[/]",
        )  # fmt: skip
    return table


def several_channels(messages: Sequence[Judged]) -> bool:
    """Whether the messages come from more than one channel, so that the table needs a column for it."""
    return len({one.channel for one in messages}) > 1
