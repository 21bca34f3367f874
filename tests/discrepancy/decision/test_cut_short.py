"""A search whose time is over gives a verdict on what it has found, and no more than that."""

from collections.abc import Callable

import pytest

from discrepancy.decision.again.cut_short import UNTRIED, cut_short
from discrepancy.decision.judgement import Judgement
from discrepancy.examine import examine, investigate
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings
from tests.discrepancy.toys import record, struck, tank


def asked(times: int) -> Callable[[], bool]:
    """Time that is over once it has been asked for so often."""
    left = [times]

    def over() -> bool:
        left[0] -= 1
        return left[0] < 0

    return over


def two_missing(over: Callable[[], bool]) -> Findings:
    recording = record(3, leak=0.05, delay_s=0.35)
    return examine(tank("leak", "level delay"), [recording], Settings(open_ended=False, over=over))


def test_with_all_the_time_it_needs_it_names_both() -> None:
    whole = two_missing(asked(1000))
    assert sorted(whole.named) == ["leak", "level delay"]
    assert UNTRIED not in whole.reasons


def test_after_one_round_there_is_one_finding_and_what_would_help_is_said() -> None:
    brief = two_missing(asked(1))
    assert [x.effect for x in brief.findings] == ["level delay"]
    assert (brief.status, brief.named) == ("unknown", [])
    assert brief.reasons[0] == UNTRIED
    assert "leak would still help" in brief.reasons


def test_a_name_beside_errors_over_budget_waits_for_the_rest_of_the_search() -> None:
    hit = struck(record(14, leak=0.05), 90.0, 100.0, 0.8)
    judged = investigate(tank("leak"), [hit], Settings(open_ended=False))
    assert isinstance(judged, Judgement)
    assert (judged.findings.status, judged.findings.named) == ("explained in part", ["leak"])
    brief = cut_short(judged).findings
    assert (brief.status, brief.named) == ("unknown", [])
    assert brief.findings[0].caveats == [UNTRIED]


def test_what_explains_everything_keeps_its_name() -> None:
    whole, at_once = (
        examine(
            tank("leak", "level delay"), [record(3, leak=0.05)], Settings(open_ended=False, over=asked(n))
        )
        for n in (1000, 2)
    )
    assert (whole.status, whole.named) == ("explained", ["leak"])
    assert (at_once.status, at_once.named) == ("explained in part", ["leak"])


@pytest.mark.parametrize("leak", [0.0, 0.05])
def test_before_the_first_effect_is_accepted_no_verdict_is_possible(leak: float) -> None:
    found = examine(tank("leak"), [record(3, leak=leak)], Settings(open_ended=False, over=lambda: True))
    assert (found.status, found.findings) == ("inconclusive", [])
    assert found.reasons[0] == UNTRIED
    assert ("leak would still help" in found.reasons) == bool(leak)
