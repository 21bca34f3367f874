"""The rounds of an experiment: diagnose, choose a manoeuvre, drive it, and diagnose all recordings together."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

from diagnosis.blind.hidden import NotHidden, Truth
from diagnosis.describe import counted
from diagnosis.experiment.choosing import Outlook, Site, best, outlooks, rivals
from diagnosis.question import Answer, Question, answer
from discrepancy.selection.state import Progress, Settings
from discrepancy.signals.findings import Findings

Outcome = Literal["nothing to distinguish", "proposed", "driven", "nothing decides", "not driven"]
"""What became of a round: there are no rivals; a manoeuvre is proposed; it was driven; none would distinguish the rivals; the machine could not drive it."""

SEEDS_APART: Final = 1000
"""Between the seeds of two rounds: each recording has noise of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Round:
    """One diagnosis, and what followed from it."""

    number: int  # 0: the recordings that were given
    findings: Findings
    groups: Sequence[Sequence[str]]  # effects that the recordings cannot distinguish
    outlooks: Sequence[Outlook] = field(default_factory=list)
    chosen: str = ""  # the manoeuvre
    scenario: Path | None = None  # the file that was written for it
    recording: Path | None = None  # of the drive
    outcome: Outcome

    @property
    def resolved(self) -> bool:
        """Whether every finding has one name, and there is at least one."""
        found = self.findings.findings
        return bool(found) and not self.groups and all(f.named for f in found)


def rounds(
    question: Question,
    site: Callable[[Answer], Site],
    settings: Settings,
    truth: Truth | None,
    out: Path,
    most: int,
    progress: Progress,
) -> Iterator[tuple[Round, Answer]]:
    """Rounds until nothing is left to distinguish, no manoeuvre of the list would distinguish the rest, or `most` manoeuvres were driven.

    site: where manoeuvres are driven; truth: what is hidden, None if nobody can drive here and now: the first manoeuvre is then only
    proposed; out: folder for scenarios and recordings. Raises a UserError for a wrong request.
    """
    for number in range(most + 1):
        progress(f"diagnosing {counted(len(question.options.paths), 'recording')}")
        answered = answer(question, settings, progress)
        done = _round(number, answered, site, truth, out, most, progress)
        yield done, answered
        if done.recording is None:
            return
        paths = [*question.options.paths, done.recording]
        question = replace(question, options=replace(question.options, paths=paths))


def _round(
    number: int,
    answered: Answer,
    site: Callable[[Answer], Site],
    truth: Truth | None,
    out: Path,
    most: int,
    progress: Progress,
) -> Round:
    judged = answered.judged
    groups = rivals(judged) if judged is not None else []
    plain = Round(
        number=number,
        findings=answered.findings,
        groups=[[a.effect for a in group] for group in groups],
        outcome="nothing to distinguish",
    )
    if judged is None or not groups:
        return plain
    here = site(answered)
    found = list(outlooks(here, judged, progress))
    chosen = best(found)
    if chosen is None:
        return replace(plain, outlooks=found, outcome="nothing decides")
    name = chosen.manoeuvre.name
    place = out / f"round-{number + 1}"
    place.mkdir(parents=True, exist_ok=True)
    proposed = replace(
        plain, outlooks=found, chosen=name, scenario=here.write(chosen.manoeuvre, place), outcome="proposed"
    )
    if truth is None or number == most:
        return proposed
    progress(f"driving {name}")
    hidden = replace(truth, seed=truth.seed + SEEDS_APART * (number + 1))
    try:
        recording = here.drive(chosen.manoeuvre, judged, hidden, place / name)
    except NotHidden as error:
        reason = Outlook(manoeuvre=chosen.manoeuvre, expected=chosen.expected, reason=str(error))
        return replace(proposed, outlooks=[reason if o is chosen else o for o in found], outcome="not driven")
    return replace(proposed, recording=recording, outcome="driven")
