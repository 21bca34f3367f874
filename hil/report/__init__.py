"""A run, or several side by side, as one HTML file that can be handed on."""

from collections.abc import Sequence
from pathlib import Path

from hil.judgement import judge_run
from hil.render import pictures_of
from hil.report import content
from hil.report.page import Section, page, plain_summary
from hil.rundir import RunDirectory, RunError
from hil.timing import judge_timing
from hil.verdict import RunVerdict, Verdict, judge_prevention, judge_warning


def write_report(run_dirs: Sequence[Path], out: Path) -> Path:
    """Write the report of `run_dirs` (at least one) to `out` and return it.

    What a directory does not hold is left out and named. RunError when a folder is no run directory.
    """
    if not run_dirs:
        raise RunError("no run to report on; name at least one run directory")
    sections = [_section(Path(path)) for path in run_dirs]
    title = " and ".join(
        dict.fromkeys(s.run.record.scenario.replace("_", " ") for s in sections)
    ).capitalize()
    out = Path(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    text = page(
        f"{title}: {', '.join(s.name for s in sections)}",
        plain_summary(sections),
        _verdicts(sections),
        sections,
    )
    partial = out.with_name(f".{out.name}.part")
    partial.write_text(text, encoding="utf-8")
    partial.replace(out)
    return out


def _section(path: Path) -> Section:
    run = RunDirectory.read(path)
    verdict = _judged(run)
    return Section(_name(run), run, verdict, content.timing_if_any(run), pictures_of(run, verdict))


def _judged(run: RunDirectory) -> RunVerdict | None:
    try:
        return judge_run(run)
    except (RunError, ValueError):
        return None  # the page says what is missing


def _name(run: RunDirectory) -> str:
    return "limits on" if run.record.limits else "limits off"


def _verdicts(sections: Sequence[Section]) -> list[Verdict]:
    free = next((s.verdict for s in sections if not s.run.record.limits and s.verdict), None)
    limited = next((s.verdict for s in sections if s.run.record.limits and s.verdict), None)
    verdicts = []
    if free is not None and free.lifted:
        verdicts.append(judge_warning(free))
    if free is not None and limited is not None:
        verdicts.append(judge_prevention(free, limited))
    for section in sections:
        if section.timing is not None:
            timed = judge_timing(section.timing)
            verdicts.append(
                Verdict(
                    question=f"{timed.question}, {section.name}", result=timed.result, reason=timed.reason
                )
            )
    return verdicts
