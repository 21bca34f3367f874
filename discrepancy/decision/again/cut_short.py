"""The verdict of a search whose time was over before it had tried everything."""

from dataclasses import replace
from typing import Final

from discrepancy.decision.judgement import Judgement
from discrepancy.signals import findings as f
from discrepancy.signals.adequacy import inadequate

UNTRIED: Final = "the search ended at its time limit, before other explanations had been tried"


def cut_short(judgement: Judgement) -> Judgement:
    """The verdict without what only a whole search can say: that nothing is missing, that nothing is left, and names beside errors over budget.

    What was accepted first may stand in for two effects that a search on would have found.
    """
    found = judgement.findings
    findings, status = found.findings, found.status
    if inadequate(found.adequacy):
        findings = [replace(x, named=False, caveats=[UNTRIED]) if x.named else x for x in findings]
    if status == "nothing missing":
        status = "inconclusive"
    elif any(x.named for x in findings):
        status = f.LESS_SURE.get(status, status)
    elif findings:
        status = "unknown"
    reasons = [UNTRIED, *found.reasons]
    return replace(judgement, findings=replace(found, findings=findings, status=status, reasons=reasons))
