"""The page about a verification: which mutants nobody noticed, and who noticed the others."""

from collections.abc import Sequence
from html import escape

from hil.verdict import Result
from report.kit.document import document
from report.run.parts import table
from testbench.verify.verify import Outcome


def page(tests: str, scenario: str, outcomes: Sequence[Outcome]) -> str:
    """The whole document."""
    missed = [each for each in outcomes if each.result is Result.FAILED]
    left = [each for each in outcomes if each.result is Result.INCONCLUSIVE]
    seen = [each for each in outcomes if each.result is Result.PASSED]
    used = sorted({question for each in outcomes for question in each.noticed})
    counts = [(question, str(sum(question in each.noticed for each in outcomes))) for question in used]
    return document(
        title=f"Verification of {tests}",
        kicker="loaderhil verify",
        head=f'<h1>Verification of {escape(tests)}</h1><p class="soft">{escape(scenario)}: {len(seen)} of {len(outcomes)} mutants noticed.</p>',
        chapters=[
            ("unnoticed", "Nobody noticed", _rows(missed)),
            ("open", "Not judged any more", _rows(left)),
            ("noticed", "Noticed", _rows(seen)),
            (
                "expectations",
                "Mutants by expectation",
                table(("expectation", "mutants"), counts, 1) if counts else "",
            ),
        ],
        footer="Written by loaderhil.",
    )


def _rows(outcomes: Sequence[Outcome]) -> str:
    rows = [
        (each.mutant.kind, each.mutant.name, each.mutant.sentence, each.verdict.reason) for each in outcomes
    ]
    return table(("kind", "mutant", "what it is", "by whom"), rows) if rows else ""
