"""One diagnosis, from what was asked to the verdict; the same for one call and for each of a fleet."""

from dataclasses import dataclass, replace
from pathlib import Path

from diagnosis.apply.applying import baseline
from diagnosis.models import Choice, find_model
from diagnosis.reading.origin import Base, base_of
from diagnosis.reading.reading import Ask, read_all
from discrepancy.checks.clocks import with_clocks
from discrepancy.decision.judge import Judgement
from discrepancy.examine import investigate
from discrepancy.model.description import Model
from discrepancy.selection.state import Progress, Settings
from discrepancy.signals.findings import Findings


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """A model by name or file, the file of its baseline if there is one, and what is to be read how."""

    model: str
    given: Path | None
    ask: Ask


@dataclass(frozen=True, slots=True)
class Answer:
    """The verdict with the model it is of, and the baseline of that; judged: what it rests on, None where nothing was usable."""

    choice: Choice
    model: Model
    base: Base
    findings: Findings
    judged: Judgement | None


def answer(question: Question, settings: Settings, progress: Progress) -> Answer:
    """Read, compare, judge. Raises a UserError about what was asked, never about what recordings contain."""
    choice = find_model(question.model)
    read = read_all(choice, question.ask, progress)
    base = base_of(choice, question.given, read.machines)
    model = baseline(choice, base.given, read.recordings)
    progress(f"simulating {model.name} and each of its {len(model.effects)} effects")
    found = investigate(with_clocks(model, read.clocks), read.recordings, settings, progress, read.complaints)
    judged = found if isinstance(found, Judgement) else None
    findings = found.findings if isinstance(found, Judgement) else found
    return Answer(choice, model, base, replace(findings, baseline=base.told), judged)
