"""A second search, with the equation for what no effect of the library explains in the baseline."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.again.beside import Beside, merged
from discrepancy.decision.drop_one import drop_one_tests
from discrepancy.decision.judge import judge
from discrepancy.decision.sizes.half_step import at_half_step
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.selection.assess import assess
from discrepancy.selection.beside_equation import built_in, size_name, switched_off
from discrepancy.selection.functions import functions
from discrepancy.selection.open_ended import FittedTerm, OpenEnded
from discrepancy.selection.state import Settings, State
from discrepancy.signals.findings import OpenTerm
from tests.discrepancy.toys import record, tank

SETTINGS = Settings()
PUMP_LAG_S = 0.6


@pytest.mark.parametrize("seed", [1, 2])
def test_a_leak_is_named_beside_a_pump_that_acts_late(seed: int) -> None:
    """The library has no pump that is late. Alone, the leak is fitted to the pump's error as well."""
    found = examine(
        tank("leak", "level scale"),
        [record(seed, leak=0.05, pump_lag_s=PUMP_LAG_S, noise=0.005)],
        SETTINGS,
    )
    assert found.named == ["leak"]
    assert found.status == "explained in part"
    leak = found.finding("leak").parameters[0]
    assert leak.low is not None
    assert leak.high is not None
    assert leak.low < 0.05 < leak.high
    assert leak.high - leak.low < 0.01
    # dx/dt = lowpass(u) - (0.2 + leak) x: what the model lacks is once (lowpass(u) - u)
    assert found.open_ended is not None
    term = found.open_ended.terms[0]
    assert term.place == "inflow"
    assert term.coefficient == pytest.approx(1.0, abs=0.05)
    lag_s = float(term.function.removeprefix("(lowpass(inflow, ").split(" s)")[0])
    assert lag_s == pytest.approx(PUMP_LAG_S, abs=0.05)
    # the equation is part of what explains the recording, not of the baseline's parameters
    assert not [n.name for n in found.nuisances if n.name.startswith("equation")]
    # three quarters of the error are gone: the equation is of first order, and a lag of 0.6 s is a quarter of the time between commands
    (level,) = found.adequacy
    assert level.simulated < 0.25 * level.simulated_before


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_beside_a_late_pump_alone_nothing_is_named(seed: int) -> None:
    recording = record(seed, pump_lag_s=PUMP_LAG_S, noise=0.005)
    found = examine(tank("leak", "level scale"), [recording], SETTINGS)
    assert found.named == []
    assert found.status == "unknown"


def with_a_drain() -> tuple[Problem, State, Problem, State, Beside]:
    """A leak of 0.05, and beside it an equation that is one: -0.05 level at the inflow. Plain and with the equation."""
    problem = Problem(tank("leak"), [record(3, leak=0.05, noise=0.005)])
    baseline = assess(problem, (), problem.start(), SETTINGS)
    level = next(f for f in functions({"level": "m"}, {"level": 1.0}) if f.text == "level")
    reported = OpenTerm(
        place="inflow",
        function="level",
        coefficient=-0.02,
        low=None,
        high=None,
        unit="1/s",
        equally_good=[],
    )
    terms = (FittedTerm(reported, level),)
    grown = problem.again(model=built_in(problem, baseline, terms))
    state = assess(grown, ("leak",), grown.start().having(leak=0.03), SETTINGS)
    return problem, baseline, grown, state, Beside(problem, baseline, baseline, terms)


def test_an_effect_that_the_equation_can_do_has_to_be_large_beside_it() -> None:
    _, _, grown, state, beside = with_a_drain()
    (test,) = drop_one_tests(grown, state, {}, OpenEnded(), SETTINGS)
    large, small = (
        OpenEnded(sse_reduction=share * test.sse_reduction, held_out_sse_reductions={})
        for share in (50.0, 5.0)
    )
    known = replace(beside, first=state)
    assert known.caveats(grown, state, test, small) == []
    (caveat,) = known.caveats(grown, state, test, large)
    assert "may be what the equation leaves" in caveat
    assert "do 9" in caveat or "do 100%" in caveat


@pytest.mark.parametrize(("share", "count"), [(5.0, 0), (12.0, 1)])
def test_an_effect_that_shows_only_beside_an_equation_has_to_be_large(share: float, count: int) -> None:
    """What an equation leaves of its own mismatch has any shape, so what the equation can do does not matter."""
    _, _, grown, state, beside = with_a_drain()
    (test,) = drop_one_tests(grown, state, {}, OpenEnded(), SETTINGS)
    equation = OpenEnded(sse_reduction=share * test.sse_reduction, held_out_sse_reductions={})
    caveats = beside.caveats(grown, state, test, equation)
    assert len(caveats) == count
    assert all("shows only beside an equation" in caveat for caveat in caveats)


def test_a_size_that_the_equation_changes_by_half_is_not_determined() -> None:
    """As in the first search: there the equation's omitted-variable bias is asked, here the two sizes are known."""
    _, _, grown, state, beside = with_a_drain()
    (test,) = drop_one_tests(grown, state, {}, OpenEnded(), SETTINGS)
    found = state.fit.values.shared["leak"]
    for factor, count in ((1.5, 0), (3.0, 1), (-1.0, 1), (0.75, 0), (0.6, 1)):
        values = state.fit.values.having(leak=factor * found)
        first = replace(state, fit=replace(state.fit, values=values))
        caveats = replace(beside, first=first).caveats(grown, state, test, OpenEnded())
        assert len(caveats) == count
        assert all("beside the equation its leak is" in caveat for caveat in caveats)


def test_the_equation_acts_on_a_finer_grid_of_the_same_windows() -> None:
    """With the signals that it was found beside, not with those of a tank without it: these are a step of the integration apart, not a drain."""
    _, _, grown, state, _ = with_a_drain()
    drained = grown.start().having(leak=0.0, **{size_name(0): -0.1})
    half = at_half_step(grown, state.noise, replace(state.fit, values=drained))
    assert half is not None
    assert half.share < 5e-3


def test_without_its_terms_the_model_is_the_plain_one() -> None:
    problem, baseline, grown, _, beside = with_a_drain()
    plain, off = problem.predict(baseline.fit.values), grown.predict(beside.before().fit.values)
    np.testing.assert_array_equal(off, plain)
    on = grown.predict(beside.before().fit.values.with_shared({"equation.1": -0.02}))
    assert np.max(np.abs(on - plain)) > 0.01
    assert switched_off(beside.terms) == {"equation.1": 0.0}


def test_an_equation_of_a_reading_starts_no_second_search() -> None:
    """An error of a sensor pulls no effect of the machine towards it."""
    said: list[str] = []
    problem = Problem(tank("leak"), [record(5, leak=0.05, lag_s=0.5, noise=0.005)])
    found = judge(problem, SETTINGS, said.append).findings
    assert found.open_ended is not None
    searched = any("searching beside" in line for line in said)
    assert searched == any(t.place == "inflow" for t in found.open_ended.terms)


def test_how_good_the_baseline_is_is_said_once() -> None:
    """The second search has an equation in its baseline, which is no longer the user's."""
    said: list[str] = []
    recording = record(1, leak=0.05, pump_lag_s=PUMP_LAG_S, noise=0.005)
    judge(Problem(tank("leak", "level scale"), [recording]), SETTINGS, said.append)
    assert any("searching beside" in line for line in said)
    assert sum("without any effect" in line for line in said) == 1


def test_a_function_stands_once_at_its_place() -> None:
    """What is left beside an equation may correct one of its own terms."""
    level = next(f for f in functions({"level": "m"}, {"level": 1.0}) if f.text == "level")

    def term(place: str, coefficient: float, reach: float) -> FittedTerm:
        low, high = coefficient - reach, coefficient + reach
        reported = OpenTerm(
            place=place, function="level", coefficient=coefficient, low=low, high=high, unit="1/s", equally_good=[]
        )  # fmt: skip
        return FittedTerm(reported, level)

    found = [
        t.reported
        for t in merged([term("inflow", 0.1, 0.03), term("outflow", 1.0, 0.1), term("inflow", -0.3, 0.04)])
    ]
    assert [t.place for t in found] == ["inflow", "outflow"]
    assert (found[0].coefficient, found[0].low, found[0].high) == pytest.approx((-0.2, -0.25, -0.15))
    assert (found[1].coefficient, found[1].low, found[1].high) == pytest.approx((1.0, 0.9, 1.1))
