"""Does the verdict hold with windows of another length? A name that comes or goes with the length is not determined.

Initial states are fitted in each window. Short windows let them make up for slow physics; in long ones, the errors of a model that is not quite right
build up until something has to explain them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

from diagnosis.describe import estimate
from discrepancy.signals.findings import Estimate, Finding, Findings, Status
from discrepancy.signals.quantities import quantity

LESS_SURE: Final[Mapping[Status, Status]] = {"explained": "explained in part", "nothing missing": "unknown"}


def across_lengths(result: Findings, others: Mapping[float, Findings]) -> Findings:
    """The result with a sentence on everything that depends on the length; others: the results by length of the windows [s]."""
    doubts = [doubt for length, other in others.items() for doubt in _doubts(result, length, other)]
    doubted = {effect for effect, _ in doubts}
    usable = {length: other for length, other in others.items() if other.status != "inconclusive"}
    sure = [f for f in _named(result) if f.effect not in doubted]
    held = [f.effect for f in sure if all(_same(f, other) for other in usable.values())]
    lengths = " and ".join(quantity(length, "s") for length in usable)
    agreed = [f"found with windows of {lengths} too: {', '.join(held)}"] if held and usable else []
    blind = [
        f"with windows of {quantity(length, 's')} these recordings allow no verdict: {'; '.join(other.reasons)}"
        for length, other in others.items()
        if other.status == "inconclusive"
    ]
    status = LESS_SURE.get(result.status, result.status) if doubts else result.status
    return replace(
        result, status=status, reasons=[*(text for _, text in doubts), *agreed, *blind, *result.reasons]
    )


def _doubts(result: Findings, length_s: float, other: Findings) -> Iterator[tuple[str, str]]:
    """Effects that are not the same with windows of that length, and a sentence on each."""
    there = f"with windows of {quantity(length_s, 's')}"
    if other.status == "inconclusive":
        return
    for f in _named(result):
        same = _same(f, other)
        if same is None and not _unseen(f, other):
            yield (
                f.effect,
                f"{f.effect} depends on the length of the windows: {there} it is {_refused(f, other)}",
            )
        elif same is not None and same.effect == f.effect and not _meet(f.parameters[0], same.parameters[0]):
            size = estimate(same.parameters[0])
            yield f.effect, f"the size of {f.effect} depends on the length of the windows: {there} {size}"
    for g in _named(other):
        if _same(g, result) is None and not _unseen(g, result):
            size = estimate(g.parameters[0])
            yield g.effect, f"{g.effect} depends on the length of the windows: {there} it is named, {size}"


def _named(result: Findings) -> list[Finding]:
    return [f for f in result.findings if f.named]


def _same(finding: Finding, result: Findings) -> Finding | None:
    """The named finding of a result that can be the same cause."""
    return next((g for g in _named(result) if _group(finding) & _group(g)), None)


def _refused(finding: Finding, result: Findings) -> str:
    """'not named', and the reason where the effect is a best proxy there."""
    proxy = next((g for g in result.findings if _group(finding) & _group(g)), None)
    return f"not named: {proxy.caveats[0]}" if proxy and proxy.caveats else "not named"


def _unseen(finding: Finding, result: Findings) -> bool:
    """Whether an effect could not be judged in a result: that is no contradiction."""
    return any(c.effect == finding.effect and c.verdict == "could not be judged" for c in result.candidates)


def _group(finding: Finding) -> set[str]:
    return {finding.effect, *(member.effect for member in finding.group)}


def _meet(one: Estimate, other: Estimate) -> bool:
    """Whether two intervals have a value in common; an end that is not known is beyond everything."""
    return _below(one.low, other.high) and _below(other.low, one.high)


def _below(low: float | None, high: float | None) -> bool:
    return low is None or high is None or low <= high
