"""The verdicts of a conformance test as exit code, suite and text."""

from collections import Counter
from collections.abc import Sequence

from hil.results import Case, Suite
from hil.verdict import Result
from testbench.conform.requirements import Requirement


def suite_of(name: str, found: Sequence[Requirement], duration_s: float) -> Suite:
    """One case per requirement."""
    return Suite(name=name, cases=tuple(Case.of(each.verdict) for each in found), time_s=duration_s)


def summary(found: Sequence[Requirement]) -> str:
    """How many of which result, in one line."""
    counts = Counter(each.result for each in found)
    parts = [f"{counts[result]} {result.value.lower()}" for result in Result if counts[result]]
    return f"{len(found)} requirements: {', '.join(parts)}"
