"""`loaderhil score`: compares findings with the sealed truth of a concealed recording.

A hidden effect that was not found counts as "not visible" in two cases: the findings say that it could not be judged, or its size is
below the smallest size that they call detectable. The two cases are the diagnosis' own statements before the truth was opened.
Exit codes: 0 every hidden effect is in a named group and no other effect was named; 5 no other effect was named, and the hidden effects
that were not found were not visible; 1 otherwise; 2 wrong use.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bus.user_error import UserError
from hil.ending import Ending

if TYPE_CHECKING:
    from diagnosis.blind.hidden import Truth
    from discrepancy.signals.findings import Candidate, Estimate, Findings


WIDTH = 120  # columns of text where the output is not a terminal


class NotScored(UserError, ValueError):
    """Findings and truth do not belong together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One hidden effect, and its place in the findings. Numbers are of its first parameter, in `unit`."""

    effect: str
    place: str  # named, in group (of `found`), proxy (an unnamed finding), not visible, missed
    found: str  # effect of the finding, empty without one
    parameter: str
    true: float
    value: float | None  # the estimate; None where the effect was not found
    low: float | None  # 95 % interval of the estimate
    high: float | None
    unit: str = ""
    why: str = ""  # the findings' reason, for "not visible" and "missed"

    @property
    def within(self) -> bool | None:
        """Whether the interval contains the true value; None without an interval."""
        if self.low is None or self.high is None:
            return None
        return self.low <= self.true <= self.high


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """All hidden effects, and the effects that were named but not hidden."""

    rows: Sequence[Row]
    false_names: Sequence[str]

    @property
    def ending(self) -> Ending:
        """PASSED, FAILED, or INCONCLUSIVE where the recording could not show the hidden effects."""
        places = {row.place for row in self.rows}
        if self.false_names or places & {"proxy", "missed"}:
            return Ending.FAILED
        return Ending.INCONCLUSIVE if "not visible" in places else Ending.PASSED


def compared(result: "Findings", truth: "Truth") -> Score:
    """Every hidden effect with its place in the findings."""
    rows = [_row(result, effect, dict(parameters)) for effect, parameters in truth.effects.items()]
    # A named group counts as one name: it is false only if no member of it was hidden.
    false = [f.effect for f in result.findings if f.named and not {*f.members} & set(truth.effects)]
    return Score(rows=rows, false_names=false)


def _row(result: "Findings", effect: str, parameters: dict[str, float]) -> Row:
    name, true = next(iter(parameters.items()))
    for f in result.findings:
        sizes = {f.effect: f.parameters, **{m.effect: m.parameters for m in f.group}}
        if effect not in sizes:
            continue
        place = "proxy" if not f.named else "named" if f.effect == effect else "in group"
        e = next(e for e in sizes[effect] if e.name == name)
        return Row(
            effect=effect,
            place=place,
            found=f.effect,
            parameter=name,
            true=true,
            value=e.value,
            low=e.low,
            high=e.high,
            unit=e.unit,
        )
    candidate = next((c for c in result.candidates if c.effect == effect), None)
    place, why = _unfound(candidate, parameters)
    unit = next((e.unit for e in candidate.smallest_detectable if e.name == name), "") if candidate else ""
    return Row(
        effect=effect, place=place, found="", parameter=name, true=true, value=None, low=None, high=None,
        unit=unit, why=why,
    )  # fmt: skip


def _unfound(candidate: "Candidate | None", parameters: Mapping[str, float]) -> tuple[str, str]:
    """ "Not visible" or "missed" for an effect that was not found, and the reason."""
    from diagnosis.describe import estimate

    if candidate is None:
        return "missed", "it is not among the candidates of the findings"
    verdict = f"the findings say: {candidate.verdict}, {candidate.reason}"
    if not candidate.smallest_detectable:
        return ("not visible" if candidate.verdict == "could not be judged" else "missed"), verdict
    # The parameter furthest above its limit decides: an effect is visible as soon as one of its parameters is.
    share, limit = max(
        (
            (_distance(parameters[e.name], e) / _distance(e.value, e), e)
            for e in candidate.smallest_detectable
        ),
        key=lambda pair: pair[0],
    )
    if share >= 1.0:
        return "missed", f"{verdict}; the same findings call it detectable from {estimate(limit)}"
    return "not visible", f"these recordings show it only from {estimate(limit)}"


def _distance(value: float, limit: "Estimate") -> float:
    """Distance of a value from the value at which the effect is off."""
    return abs(value - (limit.baseline or 0.0))


def score(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR|findings.json",
            help="Folder of findings.json and truth.sealed, or the findings alone.",
        ),
    ],
    truth: Annotated[
        Path | None,
        typer.Argument(
            metavar="[truth.sealed]", help="The sealed truth; default: truth.sealed beside the findings."
        ),
    ] = None,
) -> None:
    """Open the sealed truth and compare it with the findings: hidden effects, found effects, and their values.

    Example: `loaderhil score out/blind`
    """
    from diagnosis.blind.seal import unseal
    from diagnosis.findings_file import read_findings

    findings = folder / "findings.json" if folder.is_dir() else folder
    sealed_file = truth if truth is not None else findings.parent / "truth.sealed"
    result, sealed = read_findings(findings), unseal(sealed_file)
    if result.model != sealed.truth.model:
        raise NotScored(
            f"{findings}: belongs to model {result.model}, the sealed truth to model {sealed.truth.model}"
        )
    _check_files(sealed.files, sealed_file.parent, result.recordings)
    compared_with = compared(result, sealed.truth)
    _print_score(compared_with, result.status, sealed.truth, _console())
    raise typer.Exit(int(compared_with.ending))


def _console() -> "Console":
    """A console as wide as the terminal; without one, rich would break lines at 80 columns, and scripts that read them would fail."""
    import sys

    from rich.console import Console

    return Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else WIDTH)


def _check_files(files: dict[str, str], folder: Path, recordings: Sequence[str]) -> None:
    """Raises NotScored for findings of other recordings, and for a recording that was changed after the truth was sealed."""
    from diagnosis.blind.seal import digest

    if not set(files) & set(recordings):
        raise NotScored(
            f"the findings belong to {', '.join(recordings)}, the sealed truth to {', '.join(files)}"
        )
    for name, expected in files.items():
        # a recording that is not there any more cannot have been changed; the score needs only the findings
        if (folder / name).exists() and digest(folder / name) != expected:
            raise NotScored(f"{folder / name}: was changed after it was sealed")


def _print_score(score: Score, status: str, truth: "Truth", console: "Console") -> None:
    from rich.markup import escape
    from rich.table import Table

    from diagnosis.describe import counted
    from discrepancy.signals.quantities import figures
    from discrepancy.signals.units import shown

    table = Table(box=None, header_style="bold", pad_edge=False)
    for head in ("hidden effect", "found", "parameter", "true", "estimated", "95 %", "interval contains it"):
        table.add_column(head, overflow="fold")
    for row in score.rows:
        between = (
            f"{figures(row.low, 4)} to {figures(row.high, 4)}"
            if row.low is not None and row.high is not None
            else "–"
        )
        holds = "–" if row.within is None else "yes" if row.within else "no"
        place = f"{row.place} of {row.found}" if row.place in ("in group", "proxy") else row.place
        value = "–" if row.value is None else figures(row.value, 4)
        unit = f" [{shown(row.unit)}]" if shown(row.unit) else ""
        name = escape(f"{row.parameter}{unit}")
        table.add_row(row.effect, place, name, figures(row.true, 4), value, between, holds)
    console.print(f"verdict: {status}; hidden: {counted(len(truth.effects), 'effect')}, seed {truth.seed}")
    if score.rows:
        console.print(table)
    for line in [f"{row.effect} {row.place}: {row.why}" for row in score.rows if row.why]:
        console.print(line)
    for name in score.false_names:
        console.print(f"false name: {name}")
    console.print(f"{score.ending.name.lower()}{_why(score)}")


def _why(score: Score) -> str:
    """The reason of an inconclusive score, as the end of its line; empty otherwise."""
    if score.ending != Ending.INCONCLUSIVE:
        return ""
    unseen = [row.effect for row in score.rows if row.place == "not visible"]
    return f": according to the findings, this recording cannot show {', '.join(unseen)}"


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(score)


if TYPE_CHECKING:
    from rich.console import Console
