"""`diagnose --with FILE` reads the baseline of a model from a file; `--apply FILE` writes the findings into one."""

from collections.abc import Sequence
from pathlib import Path

from diagnosis.apply.extension import (
    Outcome,
    applied,
    extended,
    extended_text,
    not_applied,
    plain,
    read,
    with_summaries,
)
from diagnosis.models import Choice
from discrepancy.model.description import Model
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Recording


def baseline(choice: Choice, given: Path | None, recordings: Sequence[Recording]) -> Model:
    """The model with the effects of the given file as its baseline. Raises a UserError that names file and key."""
    if given is None:
        return choice.build(recordings)
    if choice.build_from is not None:
        return choice.build_from(given, recordings)
    model = choice.build(recordings)
    return extended(model, read(given, model))


def application(choice: Choice, model: Model, result: Findings, given: Path | None, out: Path) -> Outcome:
    """The files of the model extended by the named effects; given: file of the baseline, out: file to write."""
    if choice.build_from is not None:
        from diagnosis.apply.machine_files import extended_files

        return extended_files(result, given, out)
    found, messages = applied(result), not_applied(result)
    base = given.read_text(encoding="utf-8") if given is not None else plain(model.name)
    return Outcome({out: with_summaries(extended_text(base, found), found, messages)}, messages)
