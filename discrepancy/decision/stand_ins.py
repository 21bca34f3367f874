"""Effects that would leave a value of the baseline where its sheet has it.

A value far beyond its prior may be wrong, or it stands in for an effect that is missing. Where an effect of the library with the value at the
edge of what the sheet allows explains the recordings as well, they say only that one of the two is so.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discrepancy import gates
from discrepancy.decision.summary import SHEET_ALLOWS, edge_of_sheet
from discrepancy.estimation.effort import CACHED
from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.normal_equations import inverse
from discrepancy.estimation.problem import Problem, Values
from discrepancy.model.description import Parameter
from discrepancy.selection.screen import Columns, Projector, allowed, penalty, projected, sensitivities
from discrepancy.selection.state import Settings, State, free_names
from discrepancy.signals.findings import BaselineValue
from discrepancy.signals.recording import Array


def with_stand_ins(
    problem: Problem, state: State, values: Sequence[BaselineValue], settings: Settings
) -> list[BaselineValue]:
    """The values; one that contradicts the sheet is no longer sure where an effect may act in its place."""
    # of an expensive model only those that would otherwise be certain: each costs fits of the whole library
    costly = problem.costs.costly
    far = [v for v in values if v.away > gates.PRIOR_CONFLICT.threshold]
    wrong = [v.estimate.name for v in far if v.sure or not costly]
    found = []
    for value in values:
        name = value.estimate.name
        effects = stand_ins(problem, state, name, settings) if name in wrong else []
        found.append(replace(value, sure=value.sure and not effects, or_effects=effects))
    return found


def stand_ins(problem: Problem, state: State, name: str, settings: Settings) -> list[str]:
    """Effects, not accepted, that leave the nuisance `name` within the 95 % of its prior at the likelihood that it has without them.

    The linearised model proposes them; a fit with the nuisance at that edge confirms each.
    """
    nuisance = problem.model.parameter(name)
    values = state.fit.values
    edge = edge_of_sheet(nuisance, values)
    most = _by_the_sheet(problem, state.fit, name, settings) + settings.rival - SHEET_ALLOWS**2
    rest = [e for e in problem.model.effects if e.name not in state.accepted]
    columns = sensitivities(problem, values, problem.predict(values), rest, cached=True)
    projector = Projector(problem, state.noise, state.fit)
    found = []
    for of_effect, seen in zip(columns, projected(state.noise, projector, columns), strict=True):
        names = free_names(problem, (*state.accepted, of_effect.effect.name))
        for step, (X, _) in enumerate(seen):
            start = _start(state, projector, of_effect, step, X, nuisance, edge)
            if start is None:
                continue
            other = fit(problem, state.noise, [n for n in names if n != name], start, effort=CACHED)
            if other.sse <= most:
                found.append(of_effect.effect.name)
                break
    return found


def _by_the_sheet(problem: Problem, fitted: Fit, name: str, settings: Settings) -> float:
    """The SSE of a fit by the sheet's priors on all that is fitted, of which the nuisance `name` costs no more than the search asks of a parameter.

    The fit may have trusted the sheet less. Where one effect is behind several wrong values, those that stay wrong beside this one have to be paid for, or
    no effect could ever be a rival that puts them right. That one value of a sheet is wrong is as likely whether it is by five standard deviations or by
    twenty: it costs what the choice of one among all values and effects costs.
    """
    known = [problem.model.parameter(n) for n in fitted.names]
    shared = fitted.values.shared
    costs = {p.name: ((shared[p.name] - p.value) / p.prior_sd) ** 2 for p in known if p.prior_sd}
    among = len(problem.model.nuisances) + len(problem.model.effects)
    costs[name] = min(costs[name], penalty(1, among, settings.alpha))
    return fitted.data_sse + sum(costs.values())


def _start(
    state: State,
    projector: Projector,
    columns: Columns,
    step: int,
    X: Array,
    nuisance: Parameter,
    edge: float,
) -> Values | None:
    """The nuisance at the edge beside the effect's size that the linearised model has there; None if that is out of bounds.

    X: projected columns (n, k) of the effect at this trial step.
    """
    fitted = state.fit
    white = projector.states.off(state.noise.whiten(columns.raw[step]))
    by_step = -fitted.covariance @ (fitted.columns.T @ white)  # moves of the fitted parameters (m, k)
    moves = by_step[fitted.names.index(nuisance.name)]
    wanted = edge - fitted.values.shared[nuisance.name]
    # The cheapest size that moves the nuisance so far: min a'Ia - 2 g'a subject to moves'a = wanted. What it costs says little: drag that free
    # fall hides was forecast to cost 10.3, and costs 0.1.
    information, gradient = X.T @ X, X.T @ fitted.residual
    free = inverse(information)
    reach = float(moves @ free @ moves)
    if reach <= 0.0:
        return None
    best = free @ gradient
    a = best + free @ moves * ((wanted - float(moves @ best)) / reach)
    size, own = a * columns.changes[step], columns.effect.amplitude_parameters
    if not allowed(own, size):
        return None
    sizes = {p.name: float(np.clip(p.value + c, p.lower, p.upper)) for p, c in zip(own, size, strict=True)}
    return fitted.values.with_shared({**columns.effect.shapes_at_typical, **sizes, nuisance.name: edge})
