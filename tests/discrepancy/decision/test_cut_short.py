"""A search whose time is over gives a verdict on what it has found, and no more than that."""

from collections.abc import Callable
from dataclasses import replace

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


def complete(*, struck_too: bool) -> Judgement:
    recording = record(14, leak=0.05)
    recording = struck(recording, 90.0, 100.0, 0.8) if struck_too else recording
    judged = investigate(tank("leak"), [recording], Settings(open_ended=False))
    assert isinstance(judged, Judgement)
    return judged


def test_the_name_of_a_whole_search_stands_if_it_explains_everything() -> None:
    judged = complete(struck_too=False)
    assert (judged.findings.status, judged.findings.named) == ("explained", ["leak"])
    brief = cut_short(judged, whole=True).findings
    assert (brief.status, brief.named, brief.cut_short) == ("explained in part", ["leak"], True)
    assert brief.reasons[0] == UNTRIED


def test_a_value_of_the_baseline_that_a_whole_search_found_wrong_stays_wrong() -> None:
    judged = complete(struck_too=False)
    by_value = replace(judged, findings=replace(judged.findings, findings=[]))
    assert cut_short(by_value, whole=True).findings.status == "explained in part"
    assert cut_short(by_value, whole=False).findings.status == "inconclusive"


@pytest.mark.parametrize(("struck_too", "whole"), [(True, True), (False, False)])
def test_beside_errors_over_budget_or_in_half_a_search_a_name_waits(struck_too: bool, whole: bool) -> None:
    judged = complete(struck_too=struck_too)
    assert judged.findings.named == ["leak"]
    brief = cut_short(judged, whole=whole).findings
    assert (brief.status, brief.named) == ("unknown", [])
    assert brief.findings[0].caveats == [UNTRIED]


@pytest.mark.parametrize(("leak", "status"), [(0.0, "inconclusive"), (0.05, "unknown")])
def test_without_time_nothing_is_named_and_nothing_is_not_missing(leak: float, status: str) -> None:
    found = examine(tank("leak"), [record(3, leak=leak)], Settings(over=lambda: True))
    assert (found.status, found.findings, found.open_ended) == (status, [], None)
    assert found.reasons[0] == UNTRIED
    assert ("leak would still help" in found.reasons) == bool(leak)
