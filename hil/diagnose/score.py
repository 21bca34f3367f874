"""`loaderhil score`: findings against the sealed truth of a concealed recording.

Exit codes: 0 every hidden effect is in a named group and no other name was given; 5 the others were said not to be visible in
the recording, and no other name was given; 1 otherwise; 2 misused.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bus.mistake import Mistake
from hil.ending import Ending

if TYPE_CHECKING:
    from discrepancy.findings import Findings
    from hil.diagnose.hidden import Truth


class NotScored(Mistake, ValueError):
    """Findings and truth that do not belong together, or cannot be read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One hidden effect. place: named, in group (of `found`), proxy, not visible (and the findings said so), missed."""

    effect: str
    place: str
    found: str
    parameter: str
    true: float
    value: float | None
    low: float | None
    high: float | None

    @property
    def within(self) -> bool | None:
        """Whether the interval holds the truth; None where there is none."""
        if self.low is None or self.high is None:
            return None
        return self.low <= self.true <= self.high


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """All hidden effects, and names given to what is not hidden."""

    rows: Sequence[Row]
    false_names: Sequence[str]

    @property
    def ending(self) -> Ending:
        """PASSED, FAILED, or INCONCLUSIVE where the recording could not show what was hidden."""
        places = {row.place for row in self.rows}
        if self.false_names or places & {"proxy", "missed"}:
            return Ending.FAILED
        return Ending.INCONCLUSIVE if "not visible" in places else Ending.PASSED


def compared(result: "Findings", truth: "Truth") -> Score:
    """Every hidden effect with what was said of it."""
    rows = [_row(result, effect, dict(parameters)) for effect, parameters in truth.effects.items()]
    false = [
        f.effect
        for f in result.findings
        if f.named and not {f.effect, *(m.effect for m in f.group)} & set(truth.effects)
    ]
    return Score(rows=rows, false_names=false)


def _row(result: "Findings", effect: str, parameters: dict[str, float]) -> Row:
    name, true = next(iter(parameters.items()))
    for f in result.findings:
        told = {f.effect: f.parameters, **{m.effect: m.parameters for m in f.group}}
        if effect not in told:
            continue
        place = "proxy" if not f.named else "named" if f.effect == effect else "in group"
        e = next(e for e in told[effect] if e.name == name)
        return Row(
            effect=effect,
            place=place,
            found=f.effect,
            parameter=name,
            true=true,
            value=e.value,
            low=e.low,
            high=e.high,
        )
    unseen = effect in {c.effect for c in result.candidates if c.verdict == "could not be judged"}
    place = "not visible" if unseen else "missed"
    return Row(
        effect=effect, place=place, found="", parameter=name, true=true, value=None, low=None, high=None
    )


def score(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR|findings.json", help="Folder of both, or the findings with the truth named."
        ),
    ],
    truth: Annotated[
        Path | None,
        typer.Argument(metavar="[truth.sealed]", help="By default truth.sealed beside the findings."),
    ] = None,
) -> None:
    """Open the sealed truth and compare: what was hidden, what was found, with which value.

    Example: `loaderhil score out/blind`
    """
    from rich.console import Console

    from hil.diagnose.kept import read_findings
    from hil.diagnose.seal import unseal

    findings = folder / "findings.json" if folder.is_dir() else folder
    sealed_file = truth if truth is not None else findings.parent / "truth.sealed"
    result, sealed = read_findings(findings), unseal(sealed_file)
    if result.model != sealed.truth.model:
        raise NotScored(f"{findings}: is of model {result.model}, the truth of {sealed.truth.model}")
    _check_files(sealed.files, sealed_file.parent, result.recordings)
    compared_with = compared(result, sealed.truth)
    _tell(compared_with, result.status, sealed.truth, Console(width=120, highlight=False))
    raise typer.Exit(int(compared_with.ending))


def _check_files(files: dict[str, str], folder: Path, told: Sequence[str]) -> None:
    from hil.diagnose.seal import digest

    if not set(files) & set(told):
        raise NotScored(f"the findings are of {', '.join(told)}, the truth is of {', '.join(files)}")
    for name, expected in files.items():
        if (folder / name).exists() and digest(folder / name) != expected:
            raise NotScored(f"{folder / name}: was changed after it was sealed")


def _tell(score: Score, status: str, truth: "Truth", console: "Console") -> None:
    from rich.table import Table

    from discrepancy.words import counted

    table = Table(
        "hidden effect",
        "found",
        "parameter",
        "true",
        "estimated",
        "95 %",
        "holds it",
        box=None,
        header_style="bold",
    )
    for row in score.rows:
        between = f"{row.low:.4g} to {row.high:.4g}" if row.low is not None and row.high is not None else "–"
        holds = "–" if row.within is None else "yes" if row.within else "no"
        place = f"{row.place} of {row.found}" if row.place in ("in group", "proxy") else row.place
        value = "–" if row.value is None else f"{row.value:.4g}"
        table.add_row(row.effect, place, row.parameter, f"{row.true:.4g}", value, between, holds)
    console.print(f"verdict: {status}; hidden: {counted(len(truth.effects), 'effect')}, seed {truth.seed}")
    if score.rows:
        console.print(table)
    for name in score.false_names:
        console.print(f"false name: {name}")
    console.print(f"{score.ending.name.lower()}{_why(score)}")


def _why(score: Score) -> str:
    """What makes a score inconclusive."""
    unseen = [row.effect for row in score.rows if row.place == "not visible"]
    if score.ending != Ending.INCONCLUSIVE:
        return ""
    return f": this recording hardly shows {', '.join(unseen)}, and the findings say so; another manoeuvre would (--manoeuvre, --like)"


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(score)


if TYPE_CHECKING:
    from rich.console import Console
