"""A run, or several side by side, as one HTML file that can be handed on."""

from collections.abc import Sequence
from pathlib import Path

from hil.report.page import page
from hil.report.section import sections_of
from hil.rundir import RunDirectory, RunError


def write_report(run_dirs: Sequence[Path], out: Path) -> Path:
    """Write the report of `run_dirs` (at least one) to `out` and return it.

    What a directory does not hold is left out and named. RunError when a folder is no run directory.
    """
    if not run_dirs:
        raise RunError("no run to report on; name at least one run directory")
    text = page(sections_of([RunDirectory.read(path) for path in run_dirs]))
    out = Path(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    partial = out.with_name(f".{out.name}.part")
    partial.write_text(text, encoding="utf-8")
    partial.replace(out)
    return out
