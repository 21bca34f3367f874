"""A finding that does what an effect would do that was not accepted."""

import pytest

from discrepancy.decision import judge
from discrepancy.decision.drop_one import drop_one_tests
from discrepancy.decision.not_accepted import taken_over
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.selection.assess import assess
from discrepancy.selection.candidate_fits import try_shortlist
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.state import Settings
from tests.discrepancy.toys import record, tank

SETTINGS = Settings()


def caveats(seed: int, **truth: float) -> list[str]:
    """Of a delay of the level, accepted while the leak, which promises more, is not."""
    problem = Problem(tank("leak", "level delay"), [record(seed, **truth)])
    state = assess(problem, ("level delay",), problem.start(), SETTINGS)
    trials = try_shortlist(problem, state, SETTINGS)
    (test,) = drop_one_tests(problem, state, {}, OpenEnded(), SETTINGS)
    (leak,) = [t for t in trials if t.effect == "leak"]
    assert leak.raw_sse_reduction > test.sse_reduction > test.threshold
    return taken_over(problem, state, trials, test)


@pytest.mark.parametrize("seed", [1, 2])
def test_what_another_effect_would_do_is_a_borrowed_name(seed: int) -> None:
    """There is a leak and no delay; the delay is fitted to a part of what the leak does."""
    (caveat,) = caveats(seed, leak=0.05)
    assert caveat.startswith("beside leak, which explains more")


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_there_beside_it_keeps_its_name(seed: int) -> None:
    assert caveats(seed, leak=0.1, delay_s=0.1) == []


def test_a_borrowed_name_is_no_name(monkeypatch) -> None:
    monkeypatch.setattr(judge, "taken_over", lambda *_: ["beside another one nothing is left"])
    found = examine(tank("leak"), [record(1, leak=0.05)], SETTINGS)
    assert found.named == []
    assert found.finding("leak").caveats == ["beside another one nothing is left"]
