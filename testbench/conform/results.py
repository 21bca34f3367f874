"""The verdicts of a conformance test as exit code, suite and text."""

from collections import Counter
from collections.abc import Sequence

from hil.ending import Ending
from hil.results import Case, Suite
from hil.verdict import Result
from testbench.conform.requirements import Requirement


def ending_of(found: Sequence[Requirement]) -> Ending:
    """FAILED if a requirement is broken, INCONCLUSIVE if one could not be judged, else PASSED."""
    results = {each.result for each in found}
    if Result.FAILED in results:
        return Ending.FAILED
    return Ending.INCONCLUSIVE if Result.INCONCLUSIVE in results else Ending.PASSED


def suite_of(name: str, found: Sequence[Requirement], duration_s: float) -> Suite:
    """One case per requirement."""
    return Suite(name=name, cases=tuple(Case.of(each.verdict) for each in found), time_s=duration_s)


def summary(found: Sequence[Requirement]) -> str:
    """How many of which result, in one line."""
    counts = Counter(each.result for each in found)
    parts = [f"{counts[result]} {result.value.lower()}" for result in Result if counts[result]]
    return f"{len(found)} requirements: {', '.join(parts)}"
