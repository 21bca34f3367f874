"""Chooses among manoeuvres the one that best distinguishes the rivals of a diagnosis, by what each rival predicts for it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Final, Protocol

from diagnosis.blind.hidden import NotHidden, Truth
from discrepancy import gates
from discrepancy.decision.groups import Alternative
from discrepancy.decision.judgement import Judgement
from discrepancy.decision.prospect import Prospect
from discrepancy.estimation.problem import Unusable
from discrepancy.selection.state import Progress

MOST_RIVALS: Final = 4
"""Members of one group that are compared, the likeliest first: every further one costs as much as a fit in every manoeuvre."""
PLENTY: Final = 10.0 * gates.MANOEUVRE_DECIDES.threshold
"""Expected difference beyond which a manoeuvre is not the better for more: the shorter one is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manoeuvre:
    """A recording that could be made."""

    name: str
    sentence: str
    duration_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """How far two rivals would disagree on a manoeuvre."""

    one: str
    other: str
    difference: float  # in SSE

    @property
    def decides(self) -> bool:
        """Whether it would distinguish them."""
        return self.difference >= gates.MANOEUVRE_DECIDES.threshold


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlook:
    """A manoeuvre, and how far every pair of rivals would disagree on it."""

    manoeuvre: Manoeuvre
    expected: Sequence[Expected] = field(default_factory=list)
    reason: str = ""  # why it was not compared

    @property
    def worth(self) -> float:
        """From 0, it decides nothing, to 1: it decides every pair beyond doubt."""
        shares = [min(e.difference, PLENTY) / PLENTY for e in self.expected]
        return sum(shares) / len(shares) if shares else 0.0

    @property
    def decides(self) -> bool:
        """Whether it distinguishes at least one pair."""
        return any(e.decides for e in self.expected)


class Site(Protocol):
    """Where manoeuvres are driven: the bench, or the model of the diagnosis itself."""

    def manoeuvres(self) -> Sequence[Manoeuvre]:
        """What could be driven."""
        ...

    def prospect(self, manoeuvre: Manoeuvre, judged: Judgement, likely: Alternative) -> Prospect:
        """The recording that a manoeuvre would give; likely: what is missing, as far as is known. Raises Unusable, NotHidden."""
        ...

    def drive(self, manoeuvre: Manoeuvre, judged: Judgement, truth: Truth, folder: Path) -> Path:
        """Drive it with a machine that has the hidden effects, and the instruments of the present recordings.

        folder: for the recording that is returned; one of an earlier experiment is overwritten. Raises NotHidden.
        """
        ...

    def write(self, manoeuvre: Manoeuvre, folder: Path) -> Path | None:
        """The manoeuvre as a scenario file for the bench; None where there is no such file."""
        ...


def rivals(judged: Judgement) -> list[list[Alternative]]:
    """The groups of explanations that the recordings cannot distinguish, each with its likeliest members."""
    return [list(group[:MOST_RIVALS]) for group in judged.groups.values() if len(group) > 1]


def outlooks(site: Site, judged: Judgement, progress: Progress) -> Iterator[Outlook]:
    """What every manoeuvre would show, the shortest first; ends with the first that decides every pair beyond doubt."""
    groups = rivals(judged)
    likely = groups[0][0]
    for manoeuvre in sorted(site.manoeuvres(), key=lambda m: (m.duration_s, m.name)):
        progress(f"what {manoeuvre.name} would show")
        try:
            prospect = site.prospect(manoeuvre, judged, likely)
            expected = [
                Expected(one=a.effect, other=b.effect, difference=prospect.difference(a.fit, b.fit))
                for group in groups
                for a, b in combinations(group, 2)
            ]
        except (Unusable, NotHidden) as error:
            yield Outlook(manoeuvre=manoeuvre, reason=str(error))
            continue
        found = Outlook(manoeuvre=manoeuvre, expected=expected)
        yield found
        if found.worth >= 1.0:
            return


def best(found: Sequence[Outlook]) -> Outlook | None:
    """The manoeuvre that is worth most, of equals the shortest; None if none distinguishes any pair."""
    useful = [o for o in found if o.decides]
    return max(useful, key=lambda o: (o.worth, -o.manoeuvre.duration_s), default=None)
