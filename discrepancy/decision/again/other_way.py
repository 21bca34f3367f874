"""The search again with one accepted effect barred: whether others explain the recordings without it, and better.

The search takes one effect after the other, so that one which does a part of the work of two is taken before either of them. A lag in place of two
equal delays leaves both of them too little to be seen; a viscous friction in place of a dry one and air drag does, too.
"""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Final

from discrepancy import gates
from discrepancy.decision.adequacy import adequacy, granted
from discrepancy.decision.groups import TO_THE_END, difference_sd
from discrepancy.decision.judgement import Judgement
from discrepancy.decision.verdict import of_proxies
from discrepancy.estimation.effort import BRIEF
from discrepancy.estimation.fit import fit
from discrepancy.estimation.problem import Problem, Values
from discrepancy.selection.search import searched_on
from discrepancy.selection.state import Progress, Settings, State, free_names, switched_off
from discrepancy.signals import findings as f
from discrepancy.signals.adequacy import inadequate

FIRST: Final = 3  # named effects that are barred: what was accepted first had the most to stand in for


@dataclass(frozen=True, slots=True)
class OtherWay:
    """A search without one effect that explains more than the one with it."""

    barred: str
    state: State
    instead: tuple[str, ...]  # effects that it accepted and the first search did not
    gain: float  # reduction in SSE from the first to this one, under the noise of the first, less what further parameters may bring
    sd: float  # its standard deviation, from blocks of time

    @property
    def clearly_better(self) -> bool:
        """Whether the gain is beyond its own scatter, as where two effects are compared as rivals."""
        return self.gain > gates.VUONG.threshold * self.sd

    def doubts(self, finding: f.Finding) -> bool:
        """Whether it explains more without this finding, and by more than what the recordings cannot distinguish from it anyway."""
        return self.barred in finding.members and not {*self.instead} <= {*finding.members}

    @property
    def said(self) -> str:
        """Why the barred effect is no name, as the predicate of a sentence."""
        return f"without it, {' and '.join(self.instead)} explain the recordings better, by evidence {self.gain:.0f}"


def other_way(
    first: Judgement,
    judged: Callable[[tuple[State, State]], Judgement],
    settings: Settings,
    progress: Progress,
) -> tuple[Judgement, list[OtherWay]]:
    """The verdict, or one that explains everything with other effects; and clearly better ways that leave something, too.

    judged: searches on from a state, beside that of the baseline.
    """
    if first.sheet.costs.costly or first.findings.status not in ("explained in part", "unknown"):
        return first, []
    # the problem that the state was fitted to: its priors count in what the two explain
    named = {name for x in first.findings.findings if x.named for name in x.members}
    barred = [name for name in first.state.accepted if name in named][:FIRST]
    ways = list(other_ways(first.problem, first.state, barred, settings, progress))
    if ways and _within_reach(first):
        for way in ways:
            second = judged((first.baseline, way.state))
            if second.findings.status == "explained":
                return second, []
    return first, [way for way in ways if way.clearly_better]


def doubted(judgement: Judgement, ways: Sequence[OtherWay]) -> Judgement:
    """The verdict, in which an effect that others explain better without is a proxy."""
    found, reasons = [], list(judgement.findings.reasons)
    for x in judgement.findings.findings:
        better = [way for way in ways if x.named and way.doubts(x)]
        doubtful = replace(x, named=False, caveats=[way.said for way in better]) if better else x
        reasons[:0] = of_proxies([doubtful]) if better else []
        found.append(doubtful)
    named = any(x.named for x in found)
    status = judgement.findings.status if named or not found else "unknown"
    return replace(
        judgement, findings=replace(judgement.findings, findings=found, reasons=reasons, status=status)
    )


def _within_reach(first: Judgement) -> bool:
    """Whether the whole library, fitted at once, would explain everything: no part of it explains more."""
    problem, state = first.problem, first.state
    library = tuple(e.name for e in problem.model.effects)
    fitted = fit(problem, state.noise, free_names(problem, library), state.fit.values, effort=BRIEF)
    channels = adequacy(problem, first.baseline, replace(state, accepted=library, fit=fitted))
    return not inadequate(channels) and not granted(problem, channels)


def other_ways(
    problem: Problem,
    state: State,
    barred: Sequence[str],
    settings: Settings,
    progress: Progress = lambda _: None,
) -> Iterator[OtherWay]:
    """For each of the accepted effects `barred`, a search without it, where others then explain more than it did with them."""
    if len(problem.model.effects) == len(state.accepted):
        return
    # a name in place of two: more would describe the misfit of a wrong model, not the machine
    brief = replace(settings, most_effects=len(state.accepted) + 1)
    for name in barred:
        others = tuple(n for n in state.accepted if n != name)
        without, values = _barring(problem, name), _off(problem, state, name)
        if _at_most(without, state, values) >= state.fit.sse:
            continue
        progress(f"searching again without {name}")
        begin = replace(state, accepted=others, fit=replace(state.fit, values=values))
        found, _ = searched_on(without, begin, brief, progress)
        instead = tuple(n for n in found.accepted if n not in others)
        if not instead:
            continue
        # under one noise: that of the state, which counts as noise what it does not explain
        other = fit(problem, state.noise, free_names(problem, found.accepted), found.fit.values)
        # a further parameter has to bring what two equally good fits may differ by
        further = settings.same * max(len(other.names) - len(state.fit.names), 0)
        gain = state.fit.sse - other.sse - further
        if gain > 0.0:
            yield OtherWay(name, found, instead, gain, difference_sd(state.noise, state.fit, other))


def _at_most(without: Problem, state: State, values: Values) -> float:
    """SSE with all that the library has left, fitted at once: a part of it leaves no less."""
    names = free_names(without, tuple(e.name for e in without.model.effects))
    return fit(without, state.noise, names, values, effort=TO_THE_END).sse


def _off(problem: Problem, state: State, name: str) -> Values:
    """The values without an effect: it may come again, and act at another time."""
    off, values = switched_off(problem.model.effect(name)), state.fit.values
    elsewhere = {n: windows for n, windows in values.active_intervals.items() if n not in off}
    return replace(values.with_shared(off), active_intervals=elsewhere)


def _barring(problem: Problem, effect: str) -> Problem:
    """A copy whose library has not this effect; it shares the cached Jacobian columns."""
    less = copy(problem)
    less.model = replace(problem.model, effects=tuple(e for e in problem.model.effects if e.name != effect))
    return less
