"""The verdict of a search whose time was over before it had tried everything."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from discrepancy.decision.judgement import Judgement
from discrepancy.decision.verdict import WOULD_HELP, still_wrong
from discrepancy.signals import findings as f
from discrepancy.signals.adequacy import inadequate

LESS_SAID: Final[Mapping[f.Status, f.Status]] = {
    "explained": "explained in part",
    "nothing missing": "inconclusive",
}
UNTRIED: Final = "the search ended at its time limit, before other explanations had been tried"


def cut_short(judgement: Judgement, *, whole: bool) -> Judgement:
    """The verdict without what only a whole search can say: that nothing is missing, that nothing is left, and most names.

    whole: whether the first search ended by itself, and only those that doubt it were cut. Its names then stand if all errors are within their
    budgets. Else they wait: what is accepted first often stands in for two effects that a search on would find.
    """
    found = judgement.findings
    beyond = bool(inadequate(found.adequacy))
    findings = found.findings
    if beyond or not whole:
        findings = [replace(x, named=False, caveats=[UNTRIED]) if x.named else x for x in findings]
    if any(x.named for x in findings) or (whole and not findings):
        status = LESS_SAID.get(found.status, found.status)
    else:
        status = "unknown" if findings or beyond else "inconclusive"
    said = found.reasons
    if not whole:  # what was not tried may still improve the prediction: only that something is wrong, and where, is certain
        said = [*still_wrong(found.adequacy, several=len(found.recordings) > 1)]
        said += [r for r in found.reasons if r.endswith(WOULD_HELP)]
    reasons = [UNTRIED, *said]
    return replace(
        judgement,
        findings=replace(found, findings=findings, status=status, reasons=reasons, cut_short=True),
    )
