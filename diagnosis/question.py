"""One diagnosis, from the user's request to the verdict. `diagnose` calls it once, `diagnose --each` once per recording."""

from dataclasses import dataclass, replace
from pathlib import Path

from diagnosis.apply.applying import baseline
from diagnosis.models import Choice, find_model
from diagnosis.reading.origin import Base, base_of
from diagnosis.reading.reading import Read, ReadOptions, read_all
from diagnosis.sheet import Sheet, with_sheet
from discrepancy.checks.clocks import with_clocks
from discrepancy.decision.judgement import Judgement
from discrepancy.examine import investigate
from discrepancy.model.description import Model
from discrepancy.selection.state import Progress, Settings
from discrepancy.signals.findings import Findings


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """A diagnosis that a user requests. It is sent to workers of a cluster, so it holds names and paths only."""

    model: str  # name, FILE.py or FILE.fmu
    given: Path | None  # file of --with
    options: ReadOptions  # the recordings, and how to read them
    companion: Path | None = None  # file of --fmu-config
    sheet: Sheet = Sheet.DATASHEET  # how well the baseline's parameters are known


@dataclass(frozen=True, slots=True)
class Prepared:
    """Recordings that have been read, and the model with its baseline: enough for several diagnoses."""

    choice: Choice
    model: Model
    base: Base  # where the baseline comes from
    read: Read


@dataclass(frozen=True, slots=True)
class Answer:
    """The result of a diagnosis."""

    choice: Choice
    model: Model  # with its baseline
    base: Base  # where the baseline comes from
    findings: Findings
    judged: (
        Judgement | None
    )  # fits and screens behind the findings, for the page; None without a usable recording


def prepared(question: Question, progress: Progress) -> Prepared:
    """Read what the question names. Raises a UserError for a wrong request, never for the content of a recording."""
    choice = find_model(question.model, question.companion)
    read = read_all(choice, question.options, progress)
    base = base_of(choice, question.given, read.machines)
    model = with_sheet(baseline(choice, base.given, read.recordings), question.sheet)
    return Prepared(choice, model, base, read)


def diagnosed(
    ready: Prepared, settings: Settings, progress: Progress, window_s: float | None = None
) -> Answer:
    """The result of a diagnosis. window_s: length of the windows, in place of the model's."""
    model, read = ready.model, ready.read
    if window_s is not None:
        model = replace(model, window_s=window_s)
    progress(f"simulating {model.name} and each of its {len(model.effects)} effects")
    found = investigate(with_clocks(model, read.clocks), read.recordings, settings, progress, read.complaints)
    judged = found if isinstance(found, Judgement) else None
    findings = found.findings if isinstance(found, Judgement) else found
    return Answer(ready.choice, model, ready.base, replace(findings, baseline=ready.base.description), judged)


def answer(question: Question, settings: Settings, progress: Progress) -> Answer:
    """Both: read, and diagnose."""
    return diagnosed(prepared(question, progress), settings, progress)
