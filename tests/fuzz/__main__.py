"""`python -m tests.fuzz FILES [REPORT]`: the long run, one process per reader, and its table."""

import multiprocessing
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.readers import READERS, Outcome, fuzz


def one(job: tuple[str, int]) -> tuple[str, Outcome, float]:
    """A reader in a process of its own, so that its peak of memory is its own."""
    name, count = job
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        return name, fuzz(name, count, Path(folder)), time.perf_counter() - begun


def table(rows: list[tuple[str, Outcome, float]]) -> str:
    """The outcomes as Markdown."""
    lines = [
        "# Mutated files",
        "",
        "Every reader of foreign bytes on mutations of `tests/fuzz/corpus`: `make fuzz`. A file is *read* if it gives anything; else it has to end",
        "in one line. A defect is any other exception, more than 10 s, or more than 1 GiB.",
        "",
        "| reader | files | read | slowest [s] | peak memory [MiB] | files/s | defects |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for name, o, took_s in rows:
        figures = f"{o.files} | {o.read} | {o.slowest_s:.2f} | {o.peak_mib:.0f} | {o.files / took_s:.0f} | {len(o.defects)}"
        lines.append(f"| {name} | {figures} |")
    for name, o, _ in rows:
        lines += [f"- {name}, mutation {number}: {what}" for number, what in o.defects[:20]]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Number of defects, at most 1."""
    count = int(sys.argv[1])
    with multiprocessing.get_context("spawn").Pool(maxtasksperchild=1) as pool:
        rows = pool.map(one, [(name, count) for name in READERS], chunksize=1)
    text = table(rows)
    print(text)
    if len(sys.argv) > 2:
        Path(sys.argv[2]).write_text(text, encoding="utf-8")
    return int(any(outcome.defects for _, outcome, _ in rows))


if __name__ == "__main__":
    sys.exit(main())
