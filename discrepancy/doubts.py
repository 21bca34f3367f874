"""Reasons not to trust the name of an effect that the data need."""

from discrepancy import account
from discrepancy.fit import FORECAST, Fit
from discrepancy.model import Effect
from discrepancy.openended import OpenEnded, explore
from discrepancy.problem import Problem
from discrepancy.quantities import figures, quantity
from discrepancy.screen import active, switches
from discrepancy.spells import changing_nuisance, spell_of
from discrepancy.state import STRAINED, Settings, State
from discrepancy.weighing import Needed

IN_BETWEEN = 0.25  # of a change that is there or not, by which it may miss being there
LEFT = 0.5  # share of its size that an effect keeps beside the open-ended equation, or it is a proxy


def doubts(
    problem: Problem,
    state: State,
    needed: Needed,
    effect: Effect,
    fitted: Fit,
    beyond: OpenEnded,
    settings: Settings,
) -> list[str]:
    """All of them, in words; effect, fitted: the name given to what is needed, and its fit. None for a name to be trusted."""
    found = []
    if needed.gap_closed < settings.gap_closed:
        found.append(f"closes {needed.gap_closed:.0%} of the gap on held-out data")
    if needed.held_out_gain < settings.least_held_out(needed.seen):
        found.append(
            f"gains {needed.seen:.0f} where it is fitted, beside the others, and {needed.held_out_gain:.0f} on held-out data"
        )
    found += _in_between(problem, state, fitted)
    found += _beyond_physics(problem, effect, fitted)
    found += _superseded(problem, state, needed, beyond, settings)
    if spell_of(problem.model.effect(needed.effect), state.fit.values) is not None:
        found += _drifting(problem, state, needed, settings)
    return found


def _beyond_physics(problem: Problem, effect: Effect, fitted: Fit) -> list[str]:
    """More is asked for than can be, from the effect or from a nuisance."""
    ends = [account.estimate(problem.model.parameter(n), fitted) for n in active(effect)]
    found = []
    if all(e.at_bound is not None and e.value != problem.model.parameter(e.name).value for e in ends):
        found.append(f"{ends[0].name} stops at its physical bound, {quantity(ends[0].value, ends[0].unit)}")
    return found + strained(problem, fitted)


def _in_between(problem: Problem, state: State, fitted: Fit) -> list[str]:
    """Changes that are there or not, and fit best in between: what was recorded is something else, whatever helps beside them."""
    found = []
    for p in [p for name in state.accepted for p in switches(problem.model.effect(name)) if p.whole]:
        value = fitted.values.shared[p.name]
        if abs(value - p.value - p.typical) > IN_BETWEEN * abs(p.typical):
            off, on = figures(p.value), quantity(p.value + p.typical, p.unit)
            found.append(
                f"{p.name} is {off} or {on} and fits best at {figures(value)}: what was recorded does not follow the model either way"
            )
    return found


def strained(problem: Problem, fitted: Fit) -> list[str]:
    """Nuisances that data pushed further than what is known of them allows, in words."""
    found = []
    for p in [p for p in problem.model.nuisances if p.prior_sd is not None and p.name in fitted.names]:
        value = fitted.values.shared[p.name]
        away = abs(value - p.value) / (p.prior_sd or 1.0)
        if away > STRAINED or account.estimate(p, fitted).at_bound is not None:
            pushed = quantity(value, p.unit, 4)
            found.append(f"the nuisance {p.name} was pushed to {pushed}, {away:.1f} sd from its prior")
    return found


def _superseded(
    problem: Problem, state: State, needed: Needed, beyond: OpenEnded, settings: Settings
) -> list[str]:
    """An effect stood in for the open-ended equation if nothing significant is left of it beside the equation,
    and the equation in its place does as well.
    """
    effect = problem.model.effect(needed.effect)
    if effect.size != 1 or not beyond.terms:
        return []
    p = effect.parameters[0]
    size = state.fit.values.shared[p.name] - p.value
    shift, sd = beyond.beside[p.name]
    left = size + shift
    if left / size > LEFT or (left / sd) ** 2 > needed.needed:
        return []
    others = tuple(n for n in state.accepted if n != needed.effect)
    instead = explore(problem, State(state.noise, needed.without, others, ()), settings)
    if instead.held_out_gain < needed.held_out_gain - settings.same:
        return []
    return [
        f"beside {beyond.equation()} its {p.name} would go from {figures(p.value + size)} to {quantity(p.value + left, p.unit)}"
    ]


def _drifting(problem: Problem, state: State, needed: Needed, settings: Settings) -> list[str]:
    """An effect that acts for a while may stand in for a baseline parameter that is not the same all the time."""
    rival = changing_nuisance(problem, state.noise, needed.without)
    if rival is None or rival[1] < (1.0 - FORECAST) * needed.gain - settings.same:
        return []
    name, _, windows = rival
    start, end = problem.windows[windows.start].start_s, problem.windows[windows.stop - 1].end_s
    return [f"the nuisance {name} would do as well if it were another from {start:.4g} to {end:.4g} s"]
