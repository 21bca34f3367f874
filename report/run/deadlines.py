"""The report's chapter on deadlines: how each message and each task of a real-time run kept its times."""

from collections.abc import Sequence

from hil.timing.deadlines import Judged
from hil.timing.measured import TaskVerdict
from hil.timing.punctuality import Punctuality
from report.run.figures import SHOWN, spread_text
from report.run.parts import columns, table, verdict_list
from report.run.section import Section

MESSAGES = ("message", "cycle [ms]", "frames", "missing", "late", "early", "repeated", "counter jumps",
            "stale [%]", "longest gap [ms]", "verdict")  # fmt: skip
TASKS = ("task", "cycle [ms]", "start after due time", "execution", "skipped", "verdict")


def markup(sections: Sequence[Section]) -> str:
    """The chapter's markup, for the runs that were judged; below one another, because the tables are wide."""
    return "".join(
        columns([(section.name, _of_run(kept))])
        for section in sections
        if (kept := section.run.record.punctuality) is not None
    )


def _of_run(kept: Punctuality) -> str:
    tasks = table(TASKS, [_task(task) for task in kept.tasks], numbers_from=1)
    note = "Times of a task: median / 99th percentile / largest."
    buses = len({message.channel for message in kept.messages}) > 1
    head = (*(["bus"] if buses else []), *MESSAGES)
    rows = [(*([message.channel] if buses else []), *_message(message)) for message in kept.messages]
    messages = table(head, rows, numbers_from=2 if buses else 1) if rows else ""
    return f'{verdict_list([kept.frames])}{tasks}<p class="soft">{note}</p>{messages}'


def _task(task: TaskVerdict) -> tuple[str, ...]:
    return (
        SHOWN[task.name],
        f"{task.period_ns * 1e-6:g}",
        "not measured" if task.start is None else spread_text(task.start),
        "not measured" if task.execution is None else spread_text(task.execution),
        "–" if task.overruns is None else str(task.overruns),
        task.result.value,
    )


def _message(message: Judged) -> tuple[str, ...]:
    v = message.verdict
    counts = (v.missing, v.late, v.early, v.duplicates, v.counter_jumps)
    return (
        v.name,
        "–" if v.period_ns is None else f"{v.period_ns * 1e-6:g}",
        str(v.frames),
        *(str(count or "–") for count in counts),
        f"{100 * v.stale_share:.1f}" if v.stale_share else "–",
        "–" if v.worst_gap_ns is None else f"{v.worst_gap_ns * 1e-6:.1f}",
        v.result.value,
    )
