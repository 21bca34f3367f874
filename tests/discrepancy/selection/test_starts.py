"""Where candidate fits begin, and fits with cached Jacobian columns."""

import math
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.estimation.effort import AS_IT_IS, Effort
from discrepancy.estimation.fit import CONVERGED, fit
from discrepancy.estimation.noise import white_noise
from discrepancy.estimation.problem import Problem
from discrepancy.selection import candidate_fits as trials
from discrepancy.selection.assess import assess
from discrepancy.selection.starts import Starts, sized
from discrepancy.selection.state import Settings
from tests.discrepancy.toys import record, tank

LEAK = ("leak",)


def assessed(*names: str, **truth: float):
    problem = Problem(tank(*names), [record(5, **truth)])
    return problem, assess(problem, (), problem.start(), Settings())


def test_a_refit_begins_with_the_gain_that_the_score_promises() -> None:
    """A bias is linear in the readings: with everything moved along, its start is its end."""
    problem, state = assessed("level bias", bias=0.03)
    (found,) = state.scores
    start, *_ = Starts(problem, state.noise, state.fit, state.columns).of(found, None)
    assert start.sse_reduction == pytest.approx(found.raw_statistic, rel=0.01)
    ended = fit(problem, state.noise, ("area", "level.bias"), start.values)
    assert state.fit.sse - ended.sse == pytest.approx(start.sse_reduction, rel=0.01)


def test_starts_worse_than_nothing_are_left_out_where_another_is_better() -> None:
    problem, state = assessed("level delay", delay_s=0.2)
    (found,) = state.scores
    begun = Starts(problem, state.noise, state.fit, state.columns).of(found, None)
    reductions = [start.sse_reduction for start in begun]
    assert reductions == sorted(reductions, reverse=True)
    assert all(reduction > 0.0 for reduction in reductions[1:])


@pytest.mark.parametrize("shape", [True, False])
def test_an_effect_with_a_shape_begins_where_it_was_scored_if_its_score_leads_astray(
    shape: bool,
) -> None:
    """Beside a baseline that overturns, the size that a score expects may be any."""
    problem, state = assessed("leak", leak=0.05)
    [leak] = problem.model.effects
    [size] = leak.parameters
    more = (replace(size, name="leak.depth", shape=True),) if shape else ()
    shaped = replace(leak, parameters=(replace(size, typical=0.05), *more))
    problem = Problem(replace(problem.model, effects=(shaped,)), [record(5, leak=0.05)])
    state = assess(problem, (), problem.start(), Settings())
    (found,) = state.scores
    wrong = replace(found, change=-found.change)
    first, *_ = Starts(problem, state.noise, state.fit, state.columns).of(wrong, None)
    assert (first.values.shared["leak"] > 0.0) == shape


def test_cached_columns_lead_to_the_same_fit_with_fewer_simulations() -> None:
    model = replace(tank(*LEAK), jacobian_reach=1e-6)  # keeps columns, trusts them nowhere else
    problem = Problem(model, [record(5, leak=0.02)])
    noise = white_noise(problem, problem.measured - problem.predict(problem.start()))
    names = ("area", "leak")
    exact = fit(problem, noise, names, problem.start())
    far = exact.values.having(area=1.2, leak=0.1)
    spent = []
    for cached in (False, True):
        before = problem.simulations
        again = fit(problem, noise, names, far, effort=Effort(iterations=20, cached=cached))
        spent.append(problem.simulations - before)
        assert again.sse == pytest.approx(exact.sse, abs=20.0 * CONVERGED)
    assert spent[1] < spent[0]


def test_forgotten_derivatives_are_computed_again_where_they_are_asked_for() -> None:
    problem = Problem(replace(tank(*LEAK), jacobian_reach=6.0), [record(5, leak=0.02)])
    state = assess(problem, (), problem.start(), Settings())
    values, shape = state.fit.values, (problem.measured.size,)
    shared = values.shared
    trial_step = state.columns[0].changes[0][0]
    problem.jacobian.forget_derivatives()
    assert problem.jacobian.column("area", None, shared, anywhere=True) is None
    assert problem.jacobian.column("leak", trial_step, shared, anywhere=True).shape == shape
    fit(problem, state.noise, ("area",), values, effort=AS_IT_IS)
    assert problem.jacobian.column("area", None, shared).shape == shape


def test_a_prediction_is_not_simulated_twice() -> None:
    problem = Problem(tank(*LEAK), [record(5)])
    first = problem.predict(problem.start())
    again = problem.predict(problem.start())
    assert problem.simulations == 1
    np.testing.assert_array_equal(first, again)
    other = problem.start()
    other.local["level"][0] += 0.1
    assert not np.array_equal(problem.predict(other), first)


@pytest.mark.parametrize(("leak", "again"), [(0.05, True), (0.0005, False)])
def test_steps_that_cached_columns_led_astray_are_taken_again_where_there_is_no_doubt(
    leak, again, monkeypatch
) -> None:
    problem, state = assessed("leak", leak=leak)
    (found,) = state.scores
    points = Starts(problem, state.noise, state.fit, state.columns).of(found, None)
    astray = replace(state.fit, names=("area", "leak"), sse=2.0 * state.fit.sse)
    monkeypatch.setattr(
        trials, "fit", lambda *given, effort: astray if effort.cached else fit(*given, effort=effort)
    )
    (best, *_) = trials.first_steps(problem, state, found, points)
    assert (best.sse < 0.5 * state.fit.sse) == again
    assert (best is astray) != again


def test_an_effect_that_is_sure_only_as_a_whole_has_a_size() -> None:
    """Two amplitude parameters whose sum the data determine well and whose difference hardly: together they are far from zero, neither is by itself."""
    problem, state = assessed("leak", "offset", leak=0.05)
    first, second = problem.model.effects
    both = replace(first, parameters=(*first.parameters, *second.parameters))
    known = {"leak": 0.05, "offset": 0.1}
    sum_known = np.array([[1.0 / 0.05**2, 1.0 / (0.05 * 0.1)], [1.0 / (0.05 * 0.1), 1.0 / 0.1**2]])
    apart = 1e-4 * np.diag(np.diag(sum_known))
    fitted = replace(
        state.fit,
        names=("leak", "offset"),
        values=state.fit.values.with_shared(known),
        information=25.0 * sum_known + apart,
    )
    assert fitted.sd("leak") > known["leak"]
    # (1 + 1)^2 x 25 = 10 sd from nothing
    assert trials.size_of(both, fitted) == pytest.approx(1.0 - trials.SURE / 10.0, rel=1e-3)


def test_an_effect_whose_shape_is_open_is_there_all_the_same() -> None:
    """Size and shape are known as a product only: the size may be anything but nothing."""
    problem, state = assessed("leak", leak=0.05)
    [leak] = problem.model.effects
    shape = replace(leak.parameters[0], name="leak.shape", shape=True)
    shaped = replace(leak, parameters=(*leak.parameters, shape))
    one = np.ones((2, 2)) / 0.005**2
    fitted = replace(
        state.fit,
        names=("leak", "leak.shape"),
        values=state.fit.values.with_shared({"leak": 0.05, "leak.shape": 0.05}),
        information=one + 1e-3 * np.diag(np.diag(one)),
    )
    assert fitted.sd("leak") > 0.05
    # 0.05 is 10 sd from nothing while the shape is held
    assert trials.size_of(shaped, fitted) == pytest.approx(1.0 - trials.SURE / 10.0, rel=1e-2)


@pytest.mark.parametrize(("good_below", "expected"), [(2.0, 1.0), (0.5, 0.3), (0.05, 0.027), (0.0, 1.0)])
def test_a_start_that_is_too_large_moves_back(good_below: float, expected: float) -> None:
    """To three tenths, again and again, until it explains anything; where nothing does, it stays."""
    problem, state = assessed("leak", leak=0.05)
    [leak] = problem.model.effects
    point = state.fit.values.with_shared({"leak": 1.0})
    near = sized(leak, point, lambda at: 1.0 if at.shared["leak"] < good_below else -1.0).values
    assert near.shared["leak"] == pytest.approx(expected)
    assert near.shared["area"] == point.shared["area"]


@pytest.mark.parametrize(
    ("best", "expected"), [(1.0, 1.0), (5.0, 1.0 / 0.3), (20.0, 1.0 / 0.09), (1e9, 50.0)]
)
def test_a_start_that_is_too_small_moves_on(best: float, expected: float) -> None:
    """By the inverse of three tenths, again and again, while it explains more; to the bound at most."""
    problem, state = assessed("leak", leak=0.05)
    [leak] = problem.model.effects
    [parameter] = leak.parameters
    leak = replace(leak, parameters=(replace(parameter, upper=50.0),))
    point = state.fit.values.with_shared({"leak": 1.0})

    def reduction(at):
        return 1e4 - 100.0 * abs(math.log(at.shared["leak"] / best))

    assert sized(leak, point, reduction).values.shared["leak"] == pytest.approx(expected)
    # what is not beyond doubt is as its score says
    assert sized(leak, point, lambda at: reduction(at) / 1e3).values.shared["leak"] == 1.0


def test_what_scores_enough_is_tried_even_if_it_is_not_among_the_first() -> None:
    problem, state = assessed("level bias", "level sign", "level delay", bias=0.01)
    narrow = Settings(shortlist=2)
    first = max(state.scores, key=lambda s: s.statistic)
    masked = replace(first, statistic=20.0, variance_inflation=1.0)
    loud = [
        replace(s, statistic=1e3, variance_inflation=1e3, change=0.0 * s.change)
        for s in state.scores
        if s is not first
    ]
    tried = trials.try_shortlist(problem, replace(state, scores=(*loud, masked)), narrow)
    assert first.effect in [t.effect for t in tried if t.accepted(narrow)]
    ignored = replace(masked, statistic=1.0)
    tried = trials.try_shortlist(problem, replace(state, scores=(*loud, ignored)), narrow)
    assert first.effect not in [t.effect for t in tried]


def test_where_held_out_data_contradict_the_best_the_next_one_is_asked(monkeypatch) -> None:
    """A bias promises a thousand times what the leak does, and does not keep it."""
    problem, state = assessed("leak", "level bias", leak=0.05)
    found = trials.try_shortlist(problem, state, Settings())
    leak, bias = (
        replace(next(t for t in found if t.effect == name), held_out_sse_reduction=None)
        for name in ("leak", "level bias")
    )
    more = 1e3 * leak.raw_sse_reduction
    loud = replace(bias, raw_sse_reduction=more, sse_reduction=more, size=1.0)
    monkeypatch.setattr(
        trials, "finished", lambda _, __, score, *rest: loud if score.effect == bias.effect else leak
    )
    tried = {t.effect: t for t in trials.try_shortlist(problem, state, Settings())}
    assert tried[bias.effect].held_out_sse_reduction is not None
    assert not tried[bias.effect].accepted(Settings())
    assert tried[leak.effect].accepted(Settings())
