"""When a finding is the best proxy and not the cause."""

from dataclasses import replace

from discrepancy.decision.caveats import caveats_of
from discrepancy.decision.drop_one import drop_one_tests
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings
from tests.discrepancy.toys import record, tank

STRICT = Settings()


def test_an_effect_that_closes_too_little_of_the_gap_is_the_best_proxy() -> None:
    """A leak of 0.05 beside a quadratic one: the leak alone closes 97 % of what the open-ended equation shows to be possible."""
    recording = record(5, leak=0.05, square=0.02, noise=0.005)
    model = tank("leak", "level scale")
    loose, strict = (examine(model, [recording], replace(STRICT, gap_closed=limit)) for limit in (0.5, 0.99))
    assert loose.named == ["leak"]
    assert 0.9 < loose.findings[0].gap_closed < 0.99
    assert strict.named == []
    assert strict.status == "unknown"
    assert any("of the gap" in caveat for caveat in strict.findings[0].caveats)


def test_evidence_that_is_not_there_on_held_out_data_is_a_caveat() -> None:
    """The search asks it of every effect by itself; it is asked again beside the others."""
    problem = Problem(tank("leak"), [record(3, leak=0.05)])
    state, _ = search(problem, STRICT)
    [test] = drop_one_tests(problem, state, {}, OpenEnded(), STRICT)
    [leak] = problem.model.effects
    weak = replace(test, held_out_sse_reduction=0.1 * test.data_sse_reduction)
    sure, doubted = (
        caveats_of(problem, state, given, leak, state.fit, OpenEnded(), STRICT) for given in (test, weak)
    )
    assert sure == []
    assert len(doubted) == 1
    assert "held-out" in doubted[0]
