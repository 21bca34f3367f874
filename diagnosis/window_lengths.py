"""Does the verdict hold with windows of another length? A name that comes or goes with the length is not determined.

Initial states are fitted in each window. Short windows let them make up for slow physics; in long ones, the errors of a model that is not quite right
build up until something has to explain them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from diagnosis.describe import estimate
from diagnosis.reading.reading import Misuse
from discrepancy.model.description import Model
from discrepancy.model.windows import FEWEST_SAMPLES
from discrepancy.signals.findings import LESS_SURE, Finding, Findings
from discrepancy.signals.quantities import quantity


def checked_lengths(lengths: Sequence[float], model: Model) -> None:
    """Raises Misuse for a length that holds too few steps of the model, before anything is computed for minutes."""
    least = FEWEST_SAMPLES * model.step_s
    for length in lengths:
        if not length >= least:  # nor for what is not a number
            raise Misuse(
                f"--window {length:g}: {model.name} needs at least {least:g} s, {FEWEST_SAMPLES} of its steps of {model.step_s:g} s"
            )


def across_lengths(result: Findings, others: Mapping[float, Findings]) -> Findings:
    """The result with a sentence on everything that depends on the length; others: the results by length of the windows [s]."""
    usable = {length: other for length, other in others.items() if other.status != "inconclusive"}
    doubts = [doubt for length, other in usable.items() for doubt in _doubts(result, length, other)]
    doubted = {effect for effect, _ in doubts}
    sure = [f for f in result.findings if f.named and f.effect not in doubted]
    held = [f.effect for f in sure if all(_same(f, other) for other in usable.values())]
    lengths = " and ".join(quantity(length, "s") for length in usable)
    agreed = [f"found with windows of {lengths} too: {', '.join(held)}"] if held and usable else []
    blind = [
        f"with windows of {quantity(length, 's')} these recordings allow no verdict: {'; '.join(other.reasons)}"
        for length, other in others.items()
        if length not in usable
    ]
    status = LESS_SURE.get(result.status, result.status) if doubts else result.status
    return replace(
        result, status=status, reasons=[*(text for _, text in doubts), *agreed, *blind, *result.reasons]
    )


def _doubts(result: Findings, length_s: float, other: Findings) -> Iterator[tuple[str, str]]:
    """Effects that are not the same with windows of that length, and a sentence on each."""
    there = f"with windows of {quantity(length_s, 's')}"
    for f in [f for f in result.findings if f.named]:
        same = _same(f, other)
        if same is None:
            if not _unseen(f, other):
                text = f"{f.effect} depends on the length of the windows: {there} it is {_refused(f, other)}"
                yield f.effect, text
        elif same.effect == f.effect and not f.parameters[0].overlaps(same.parameters[0]):
            size = estimate(same.parameters[0])
            yield f.effect, f"the size of {f.effect} depends on the length of the windows: {there} {size}"
    for g in [g for g in other.findings if g.named]:
        if _same(g, result) is None and not _unseen(g, result):
            size = estimate(g.parameters[0])
            yield g.effect, f"{g.effect} depends on the length of the windows: {there} it is named, {size}"


def _same(finding: Finding, result: Findings) -> Finding | None:
    """The named finding of a result that can be the same cause."""
    return next((g for g in result.findings if g.named and {*finding.members} & {*g.members}), None)


def _refused(finding: Finding, result: Findings) -> str:
    """'not named', and the reason where the effect is a best proxy there."""
    proxy = next((g for g in result.findings if {*finding.members} & {*g.members}), None)
    return f"not named: {proxy.caveats[0]}" if proxy and proxy.caveats else "not named"


def _unseen(finding: Finding, result: Findings) -> bool:
    """Whether an effect could not be judged in a result: that is no contradiction."""
    return any(c.effect == finding.effect and c.verdict == "could not be judged" for c in result.candidates)
