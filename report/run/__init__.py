"""The report of a run, or of several side by side, as one self-contained HTML file."""

from collections.abc import Sequence
from pathlib import Path

from hil.rundir import RunDirectory, RunError, writing
from report.run.page import page
from report.run.section import sections_of


def write_report(run_dirs: Sequence[Path], out: Path) -> Path:
    """Write the report of `run_dirs` (at least one) to `out` and return it.

    Parts that a directory does not hold are left out and listed. RunError when a folder is no run directory.
    """
    if not run_dirs:
        raise RunError("no run to report on; name at least one run directory")
    text = page(sections_of([RunDirectory.read(path) for path in run_dirs]))
    out = Path(out)
    partial = out.with_name(f".{out.name}.part")
    with writing(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        try:
            partial.write_text(text, encoding="utf-8")
            # renamed when complete: a reader never sees half a page
            partial.replace(out)
        finally:
            partial.unlink(missing_ok=True)
    return out
