"""A second search, beside an equation: which names hold with what no effect of the library explains in the baseline.

A mismatch outside the library pulls effects of the library towards it, and they become proxies. The equation of the open-ended search describes it
well enough to be a part of the baseline; effects that pass all gates there are named beside it. Only where simulations are cheap.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from discrepancy import gates
from discrepancy.decision.drop_one import DropOneTest
from discrepancy.decision.judgement import Judgement
from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.problem import Problem
from discrepancy.selection.beside_equation import built_in, refitted, switched_off
from discrepancy.selection.candidate_fits import held_out_residual
from discrepancy.selection.open_ended import FittedTerm, OpenEnded
from discrepancy.selection.state import Progress, Settings, State, free_names
from discrepancy.signals import findings as f
from discrepancy.signals.quantities import figures, quantity

ENOUGH: Final[tuple[f.Status, ...]] = ("explained", "nothing missing", "inconclusive")
"""Verdicts after which no second search follows."""


@dataclass(frozen=True, slots=True)
class Beside:
    """An equation in the baseline of a search, and what was there without it."""

    plain: Problem
    baseline: State  # of the plain problem, without effects
    first: State  # the same, with all that the first search accepted
    terms: tuple[FittedTerm, ...]

    def before(self) -> State:
        """The plain baseline as a state of the search beside the equation: every term is zero."""
        fitted = self.baseline.fit
        off = fitted.values.with_shared(switched_off(self.terms))
        return replace(self.baseline, fit=replace(fitted, values=off))

    def equation(self, problem: Problem, state: State, left: OpenEnded, settings: Settings) -> OpenEnded:
        """The equation as it was fitted beside the effects, with its evidence beside them, and what is left: `left`."""
        noise, values = state.noise, state.fit.values
        without = fit(self.plain, noise, free_names(self.plain, state.accepted), values)
        before = held_out_residual(self.plain, noise, state.accepted, without.values, settings)
        after = held_out_residual(problem, noise, state.accepted, values, settings)
        gained = np.bincount(noise.row_channel, before**2 - after**2, len(problem.channels))
        return OpenEnded(
            merged((*refitted(self.terms, state.fit), *left.terms)),
            without.sse - state.fit.sse + left.sse_reduction,
            left.threshold,
            left.unconfirmed,
            {
                name: float(own) + left.held_out_sse_reductions.get(name, 0.0)
                for name, own in zip(problem.channels, gained, strict=True)
            },
            left.parameter_shifts,
        )

    def caveats(self, problem: Problem, state: State, test: DropOneTest, equation: OpenEnded) -> list[str]:
        """Caveats if the effect may be what the equation leaves of its own mismatch: small beside it, or another size than without."""
        if test.effect not in self.first.accepted:
            return self._only_beside(test, equation)
        return [*self._small(problem, state, test, equation), *self._changed(problem, state, test)]

    def _only_beside(self, test: DropOneTest, equation: OpenEnded) -> list[str]:
        """What an equation leaves of its own mismatch has any shape, so that it does not count what the equation can do (ADR 100)."""
        if test.sse_reduction >= gates.EQUATION_ERROR.threshold * equation.sse_reduction:
            return []
        return [
            f"shows only beside an equation, with evidence {test.sse_reduction:.0f} where the equation has {equation.sse_reduction:.0f}: it may be what the equation leaves"
        ]

    def _changed(self, problem: Problem, state: State, test: DropOneTest) -> list[str]:
        """A size that another cause changes by half of itself is not determined, whether or not the rest is significant (ADR 50)."""
        effect = problem.model.effect(test.effect)
        if effect.size != 1:
            return []
        p = effect.parameters[0]
        before, after = (s.fit.values.shared[p.name] for s in (self.first, state))
        was, left = before - p.value, after - p.value
        if abs(left - was) < (1.0 - gates.LEFT_BESIDE_EQUATION.threshold) * abs(was):
            return []
        return [
            f"beside the equation its {p.name} is {quantity(after, p.unit)}, and without it {figures(before)}"
        ]

    def _small(self, problem: Problem, state: State, test: DropOneTest, equation: OpenEnded) -> list[str]:
        alike = self._alike(problem, state.fit, test.effect)
        least = gates.EQUATION_ERROR.threshold * alike * equation.sse_reduction
        if test.sse_reduction >= least:
            return []
        return [
            f"has evidence {test.sse_reduction:.0f} beside an equation with {equation.sse_reduction:.0f} that can do {alike:.0%} of it: it may be what the equation leaves"
        ]

    def _alike(self, problem: Problem, fitted: Fit, effect: str) -> float:
        """The share of an effect's change of the outputs that other sizes and widths of the equation can do, nuisances apart."""
        names = fitted.names
        own, terms = set(problem.model.effect(effect).names), switched_off(self.terms)
        X, A, N = (
            fitted.columns[:, [i for i, name in enumerate(names) if name in some]]
            for some in (own, terms, self.plain.nuisance_names)
        )
        X, A = (part - N @ np.linalg.lstsq(N, part, rcond=None)[0] if N.size else part for part in (X, A))
        done = A @ np.linalg.lstsq(A, X, rcond=None)[0]
        return float(np.sum(done**2) / max(np.sum(X**2), 1e-300))


def merged(terms: Sequence[FittedTerm]) -> tuple[FittedTerm, ...]:
    """The terms, those of one function at one place as one: what is left may correct a term that is there already."""
    found: dict[tuple[str, str], FittedTerm] = {}
    for term in terms:
        place = term.reported.place, term.reported.function
        before = found.get(place)
        found[place] = (
            term if before is None else replace(term, reported=_sum(before.reported, term.reported))
        )
    return tuple(found.values())


def _sum(one: f.OpenTerm, other: f.OpenTerm) -> f.OpenTerm:
    size = one.coefficient + other.coefficient
    if one.low is None or one.high is None or other.low is None or other.high is None:
        return replace(one, coefficient=size, low=None, high=None)
    reach = float(np.hypot(one.high - one.low, other.high - other.low)) / 2.0
    return replace(one, coefficient=size, low=size - reach, high=size + reach)


def beside_equation(
    first: Judgement, judged: Callable[[Problem, Beside], Judgement], progress: Progress
) -> Judgement:
    """The first verdict, or that of a search beside its equation where this one holds more names. judged: one search and its verdict."""
    problem = first.sheet  # beside the equation, the recordings may no longer contradict it
    places = {port.name for port in problem.model.ports}
    # an error of a reading pulls no effect of the machine towards it
    terms = tuple(t for t in first.left.terms if t.reported.place in places)
    if problem.costs.costly or not terms or first.findings.status in ENOUGH:
        return first
    names = "; ".join(first.findings.named)
    so_far = first.findings.status + (f": {names}" if names else "")
    progress(f"so far {so_far}; searching beside {first.left.equation()}")
    grown = problem.again(model=built_in(problem, first.state, terms))
    second = judged(grown, Beside(problem, first.baseline, first.state, terms))
    if not _says_more(first.findings, second.findings):
        return first
    both = problem.simulations + grown.simulations
    return replace(second, findings=replace(second.findings, simulations=both))


def _says_more(first: f.Findings, second: f.Findings) -> bool:
    """Whether the second has a name more, and every name of the first with a size that agrees with it.

    A size that the equation changes is not determined by these recordings, and neither is what was found beside it.
    """
    names = [x for x in second.findings if x.named]
    kept = [any(_agree(x, y) for y in names) for x in first.findings if x.named]
    return len(names) > len(kept) and all(kept)


def _agree(one: f.Finding, other: f.Finding) -> bool:
    """Whether two findings can be the same cause: the same effect with intervals of its amplitude that meet, or another one of the group."""
    if one.effect != other.effect:
        return bool({*one.members} & {*other.members})
    return one.parameters[0].overlaps(other.parameters[0])
