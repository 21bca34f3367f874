"""`diagnose --each`: diagnoses each recording alone, on the processors of this machine or of a cluster, and writes one table.

DIR/results.parquet             a row per recording: verdict, names, first finding with its interval, all findings as JSON
DIR/findings/RECORDING.json     findings.json of each
"""

import hashlib
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from diagnosis.blind.seal import digest
from diagnosis.describe import counted
from diagnosis.fleet.cluster import Tally, carry_out
from diagnosis.fleet.store import Row, Store
from diagnosis.question import Question, answer
from discrepancy.selection.state import Settings
from discrepancy.signals.adequacy import STILL_WRONG
from discrepancy.signals.findings import Findings, to_json

if TYPE_CHECKING:
    from rich.console import Console

SHOWN = 10  # recordings without a named effect, in the summary
EVERY_S = 10.0  # between lines of progress where there is no terminal


def diagnose_each(
    question: Question, folder: Path, scheduler: str | None, workers: int | None, console: "Console"
) -> Tally:
    """Diagnose each recording of the question by itself and keep the results in the folder."""
    arms = {
        key: replace(question, options=replace(question.options, paths=[path]))
        for path, key in zip(question.options.paths, keys(question.options.paths), strict=True)
    }
    store = Store(folder, _work(question))
    with bar(console) as report:
        tally = carry_out(diagnosed, arms, store, scheduler=scheduler, workers=workers, report=report)
    table = store.collect(arms, tally.failures)
    texts = folder / "findings"
    texts.mkdir(exist_ok=True)
    # from the store and not from this run alone: results of an earlier, interrupted run count as well
    rows = store.rows(arms)
    for row in rows:
        (texts / f"{row['key']}.json").write_text(str(row["findings"]), encoding="utf-8")
    for line in summary(rows, tally.failures):
        print(line)
    print(f"written: {table}")
    return tally


def keys(paths: Sequence[Path]) -> list[str]:
    """A key per recording: its name and a digest of its content, so that a changed recording is diagnosed again and others are not."""
    # 48 bits: enough for millions of recordings, and short enough for a file name
    return [f"{path.name} {_digest(path)[:12]}" for path in paths]


def diagnosed(question: Question) -> Row:
    """The result of one recording as a row of the table; `findings` is the text of findings.json."""
    start = time.monotonic()
    found = answer(question, Settings(), lambda _: None).findings
    return {
        "recording": question.options.paths[0].name,
        "baseline": found.baseline,
        "status": found.status,
        "named": ", ".join(found.named),
        "reason": "; ".join(found.reasons),
        "left": "; ".join(reason for reason in found.reasons if reason.startswith(STILL_WRONG)),
        **_first(found),
        "samples": found.samples,
        "seconds": time.monotonic() - start,
        "findings": to_json(found),
    }


def _first(found: Findings) -> dict[str, str | float | None]:
    """The first parameter of the first named finding with its interval; None for each without a name."""
    names = ("effect", "parameter", "value", "low", "high", "unit")
    named = [f for f in found.findings if f.named]
    if not named:
        return dict.fromkeys(names)
    e = named[0].parameters[0]
    return dict(zip(names, (named[0].effect, e.name, e.value, e.low, e.high, e.unit), strict=True))


def summary(rows: Sequence[Row], failures: Mapping[str, str]) -> Iterator[str]:
    """Lines for the terminal: how often each verdict, machine and name occurs, and the recordings without a name."""
    verdicts = Counter(str(row["status"]) for row in rows)
    yield f"{counted(len(rows), 'recording')}: {', '.join(f'{n} {status}' for status, n in verdicts.most_common())}"
    machines = Counter(str(row["baseline"]).partition(", ")[0] for row in rows if row["baseline"])
    yield from (f"  {n} of {len(rows)} compared with {machine}" for machine, n in machines.most_common())
    names = Counter(name for row in rows for name in str(row["named"]).split(", ") if name)
    yield from (f"  {n} of {len(rows)}: {name}" for name, n in names.most_common())
    without = [row for row in rows if not row["named"] and row["status"] != "nothing missing"]
    for row in without[:SHOWN]:
        reason = str(row["reason"]).removeprefix(f"{row['recording']}: ")
        yield f"  {row['recording']}: {row['status']}: {reason}"
    part = [row for row in rows if row["named"] and row["left"]]
    yield from (f"  {row['recording']}: {row['status']}: {row['left']}" for row in part[:SHOWN])
    if len(part) > SHOWN:
        yield f"  and {len(part) - SHOWN} more with an error beyond its budget; the table has them all"
    if len(without) > SHOWN:
        yield f"  and {len(without) - SHOWN} more without a name; the table has them all"
    yield from (f"  failed: {key}: {reason}" for key, reason in failures.items())


def _duration(seconds: float) -> str:
    """'under a minute', 'about 3 min'."""
    return "under a minute" if seconds < 60.0 else f"about {seconds / 60.0:.0f} min"


def _work(question: Question) -> dict[str, str]:
    """Everything besides the recording that its result depends on: options, version, and the content of model, baseline and DBC files."""
    import importlib.metadata

    model = Path(question.model)
    # an FMU has a companion file: the given one, else the one beside it
    companion = question.companion or (model.with_suffix(".toml") if model.suffix == ".fmu" else None)
    files = [
        path for path in (model, companion, question.given, *question.options.dbcs) if path and path.is_file()
    ]
    return {
        # paths left out: the recording's own key stands for it, and a moved folder is no new question
        "question": repr(replace(question, options=replace(question.options, paths=[]))),
        "version": importlib.metadata.version("loaderhil"),
        **{f"content of {path}": _digest(path) for path in files},
    }


def _digest(path: Path) -> str:
    """SHA-256 of a recording, or of all files of a run joined by '+'."""
    parts = [path] if path.exists() else [Path(part) for part in str(path).split("+")]
    return hashlib.sha256("".join(digest(part) for part in parts).encode()).hexdigest()


@contextmanager
def bar(console: "Console") -> "Iterator[Report]":
    """A function that shows progress: a bar on a terminal, elsewhere one line in EVERY_S on standard error."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    if console.is_terminal:
        with Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=console,
        ) as progress:
            task = progress.add_task("diagnosing")
            yield lambda t: progress.update(
                task,
                total=t.total,
                completed=t.total - t.left,
                description=f"diagnosing, {len(t.failures)} failed" if t.failures else "diagnosing",
            )
        return
    start, last = time.monotonic(), -EVERY_S

    def line(t: Tally) -> None:
        nonlocal last
        now = time.monotonic() - start
        # the last report is always printed
        if now - last < EVERY_S and t.left:
            return
        last = now
        rest = f", {_duration(now / t.done * t.left)} left" if t.done and t.left else ""
        failed = f", {len(t.failures)} failed" if t.failures else ""
        print(
            f"{now:6.0f} s  {t.total - t.left} of {t.total} done{failed}{rest}", file=sys.stderr, flush=True
        )

    yield line


if TYPE_CHECKING:
    from collections.abc import Callable

    Report = Callable[[Tally], None]
