"""Caveats: reasons why the name of an effect that the data need is not to be trusted."""

import numpy as np

from discrepancy import gates
from discrepancy.decision.drop_one import DropOneTest
from discrepancy.decision.groups import in_between
from discrepancy.decision.summary import estimate
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect
from discrepancy.selection.active_intervals import active_interval_of, time_varying_nuisance
from discrepancy.selection.open_ended import OpenEnded, explore
from discrepancy.selection.screen import FEW
from discrepancy.selection.state import Settings, State, switched_off
from discrepancy.signals.quantities import figures, quantity


def caveats_of(
    problem: Problem,
    state: State,
    test: DropOneTest,
    effect: Effect,
    fitted: Fit,
    equation: OpenEnded,
    settings: Settings,
) -> list[str]:
    """All of them, as sentences; none for a name to be trusted. effect, fitted: the name given to the tested effect, and its fit."""
    found = []
    if test.gap_closed < settings.gap_closed:
        found.append(f"closes {test.gap_closed:.0%} of the gap on held-out data")
    if test.held_out_sse_reduction < settings.least_held_out(test.data_sse_reduction):
        found.append(
            f"has evidence {test.data_sse_reduction:.0f} on the data it was fitted to, beside the other effects, "
            f"and {test.held_out_sse_reduction:.0f} on held-out data"
        )
    found += _in_between(problem, state, fitted)
    found += _at_bounds(problem, effect, fitted)
    found += _at_baseline(problem, state, effect, fitted)
    found += _cancelled(problem, state, test)
    found += prior_conflicts(problem, fitted)
    found += _superseded(problem, state, test, equation, settings)
    if active_interval_of(problem.model.effect(test.effect), state.fit.values) is not None:
        found += _changing_baseline(problem, state, test, settings)
    return found


def _at_bounds(problem: Problem, effect: Effect, fitted: Fit) -> list[str]:
    """Amplitude parameters that stop at what is physically possible; of a profile, only if all do."""
    ends = [estimate(p, fitted) for p in effect.amplitude_parameters]
    at_bound = [
        e for e in ends if e.at_bound is not None and e.value != problem.model.parameter(e.name).value
    ]
    if at_bound and (len(ends) <= FEW or len(at_bound) == len(ends)):
        first = at_bound[0]
        return [f"{first.name} stops at its physical bound, {quantity(first.value, first.unit)}"]
    return []


def _at_baseline(problem: Problem, state: State, effect: Effect, fitted: Fit) -> list[str]:
    """Amplitude parameters whose interval holds the baseline; profiles are not asked, most of whose values may be zero."""
    own = effect.amplitude_parameters
    if len(own) > FEW:
        return []
    found = []
    for p, e in [(p, estimate(p, fitted, state.noise)) for p in own]:
        away, reach = abs(e.value - p.value), 0.5 * ((e.high or 0.0) - (e.low or 0.0))
        if away < gates.OFF_BASELINE.threshold * reach:
            interval = f"{figures(e.low or 0.0)} to {quantity(e.high or 0.0, e.unit)}"
            found.append(
                f"{p.name} may be {quantity(p.value, p.unit)}, as in the baseline (95 %: {interval})"
            )
    return found


def _cancelled(problem: Problem, state: State, test: DropOneTest) -> list[str]:
    """Other findings that undo the effect: the outputs hardly change when both are dropped."""
    noise, values = state.noise, state.fit.values
    own = switched_off(problem.model.effect(test.effect))
    whole = problem.predict(values)

    def change(off: dict[str, float]) -> float:
        return float(np.linalg.norm(noise.whiten(whole - problem.predict(values.with_shared(off)))))

    found = []
    for name in [n for n in state.accepted if n != test.effect]:
        other = switched_off(problem.model.effect(name))
        smaller, both = min(change(own), change(other)), change(own | other)
        if both < gates.NOT_CANCELLING.threshold * smaller:
            found.append(
                f"it and {name} cancel: together they change the outputs by {both / smaller:.0%} of one of them"
            )
    return found


def _in_between(problem: Problem, state: State, fitted: Fit) -> list[str]:
    """Discrete parameters that fit best in between: the recording follows neither, whatever helps beside them."""
    found = []
    accepted = [problem.model.effect(name) for name in state.accepted]
    for p in [p for effect in accepted for p in effect.amplitude_parameters if in_between(p, fitted)]:
        off, on = figures(p.value), quantity(p.value + p.typical, p.unit)
        value = figures(fitted.values.shared[p.name])
        found.append(
            f"{p.name} can only be {off} or {on} and fits best at {value}: the recording follows neither"
        )
    return found


def prior_conflicts(problem: Problem, fitted: Fit) -> list[str]:
    """Nuisances that the data pushed further than what is known of them allows, as sentences."""
    found = []
    for p in [p for p in problem.model.nuisances if p.prior_sd is not None and p.name in fitted.names]:
        value = fitted.values.shared[p.name]
        away = abs(value - p.value) / (p.prior_sd or 1.0)
        if away > gates.PRIOR_CONFLICT.threshold or estimate(p, fitted).at_bound is not None:
            pushed = quantity(value, p.unit, 4)
            found.append(f"the nuisance {p.name} was pushed to {pushed}, {away:.1f} sd from its prior")
    return found


def _superseded(
    problem: Problem, state: State, test: DropOneTest, equation: OpenEnded, settings: Settings
) -> list[str]:
    """The effect stood in for the open-ended equation: nothing significant is left of it beside the equation, which does as well alone."""
    effect = problem.model.effect(test.effect)
    if effect.size != 1 or not equation.terms:
        return []
    p = effect.parameters[0]
    size = state.fit.values.shared[p.name] - p.value
    shift, sd = equation.parameter_shifts[p.name]
    left = size + shift
    if left / size > gates.LEFT_BESIDE_EQUATION.threshold or (left / sd) ** 2 > test.threshold:
        return []
    others = tuple(n for n in state.accepted if n != test.effect)
    instead = explore(problem, State(state.noise, test.without, others, ()), settings)
    if instead.held_out_sse_reduction < test.held_out_sse_reduction - settings.same:
        return []
    before, after = figures(p.value + size), quantity(p.value + left, p.unit)
    return [f"beside {equation.equation()} its {p.name} would change from {before} to {after}"]


def _changing_baseline(problem: Problem, state: State, test: DropOneTest, settings: Settings) -> list[str]:
    """A temporary effect may stand in for a baseline parameter that is not the same all the time."""
    rival = time_varying_nuisance(problem, state.noise, test.without)
    least = gates.NUISANCE_IN_TIME.threshold * test.sse_reduction - settings.same
    if rival is None or rival[1] < least:
        return []
    name, _, windows = rival
    start, end = problem.windows[windows.start].start_s, problem.windows[windows.stop - 1].end_s
    return [f"the nuisance {name} would do as well with another value from {start:.4g} to {end:.4g} s"]
