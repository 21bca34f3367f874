"""Caveats: reasons why an accepted effect is not named as the cause. An effect without any is named."""

from collections.abc import Sequence

import numpy as np

from discrepancy import gates
from discrepancy.decision.drift_or_step import step_in_its_place
from discrepancy.decision.drop_one import DropOneTest
from discrepancy.decision.groups import in_between
from discrepancy.decision.sizes import flat
from discrepancy.decision.sizes.half_step import HalfStep
from discrepancy.decision.summary import beyond_prior, edge_of_sheet, estimate, estimated
from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.normal_equations import inverse
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Parameter
from discrepancy.selection.active_intervals import active_interval_of, runs, time_varying_nuisance
from discrepancy.selection.candidate_fits import SURE, shapes_held
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.state import Settings, State, switched_off
from discrepancy.signals import findings as f
from discrepancy.signals.quantities import figures, quantity, span


def caveats_of(
    problem: Problem,
    state: State,
    test: DropOneTest,
    effect: Effect,
    fitted: Fit,
    equation: OpenEnded,
    settings: Settings,
) -> list[str]:
    """All caveats as sentences; empty for an effect that is named. effect, fitted: the best member of the group, and its fit."""
    found = []
    if test.gap_closed < settings.gap_closed:
        found.append(f"closes {test.gap_closed:.0%} of the gap on held-out data")
    if test.held_out_sse_reduction < settings.least_held_out(test.data_sse_reduction):
        found.append(
            f"has {_evidence(test.data_sse_reduction)} on the data it was fitted to, beside the other effects, "
            f"and {_evidence(test.held_out_sse_reduction)} on held-out data"
        )
    found += _own_reading(effect, test)
    found += _mirrored(problem, state, test, effect)
    found += _early_beside_lag(state, effect)
    found += step_in_its_place(problem, state, test.without, effect, fitted, settings)
    found += _in_between(problem, state, fitted)
    kept = _present(problem, effect, fitted, state.noise)
    found += _at_bounds(effect, fitted, kept)
    found += at_baseline(kept, fitted, effect)
    found += _cancelled(problem, state, test)
    found += prior_conflicts(problem, fitted, state.noise)
    found += _superseded(problem, state, test, effect, equation)
    if active_interval_of(problem.model.effect(test.effect), state.fit.values) is not None:
        found += _changing_baseline(problem, state, test, settings)
    return found


def beside_rest(test: DropOneTest, confounded_share: float, *, stated: bool) -> list[str]:
    """Caveats of an effect of a model that is further from the recordings than its sensors are wrong, where what is left over may do as much.

    confounded_share: of the effect, that nuisances can do. What is left of it is compared with the recordings' errors of every kind. stated: whether the
    model says what disturbances do to every channel.
    """
    gained = test.gained
    further = "in a model that is further from the recordings than its sensors are wrong: what is left may do as much"
    further += "" if stated else " (state `disturbances` if that is chance)"
    if gained < gates.SEEN_BESIDE_REST.threshold and test.sse_reduction < gates.CLEAR_BESIDE_REST.threshold:
        return [f"takes {gained:.1%} off the squared error of the channel that it improves most, {further}"]
    imitated = confounded_share > gates.IMITATED_BESIDE_REST.threshold
    if imitated and gained < gates.MUCH_BESIDE_REST.threshold:
        return [
            f"can be imitated by the baseline's own parameters to {confounded_share:.1%}, and takes {gained:.0%} off the squared error of the channel that it improves most, {further}"
        ]
    return []


def of_the_step(problem: Problem, state: State, effect: Effect, half: HalfStep | None) -> list[str]:
    """A caveat if small steps would change the effect's size by half of itself."""
    p = effect.amplitude_parameters[0]
    if half is None or not half.of_integration or p.name not in half.shifts:
        return []
    value, shift = state.fit.values.shared[p.name], half.shifts[p.name]
    if half.evidence <= gates.HALF_STEP.threshold or abs(shift) < (
        1.0 - gates.LEFT_BESIDE_EQUATION.threshold
    ) * abs(value - p.value):
        return []
    step = quantity(problem.model.step_s, "s")
    return [
        f"in smaller steps than the model's {step} its {p.name} would be about {quantity(value + shift, p.unit, 2)} and not {figures(value)}: it may be an error of the integration"
    ]


def _mirrored(problem: Problem, state: State, test: DropOneTest, effect: Effect) -> list[str]:
    """A caveat if a delay of the other sign explains half as much: what helps is then the mean of neighbours of a noisy input, not the shift."""
    name = effect.parameters[0].name
    if not name.endswith(".delay") or effect.name != test.effect or problem.costs.costly:
        return []
    size = state.fit.values.shared[name]
    names = tuple(n for n in state.fit.names if n != name)
    other = fit(problem, state.noise, names, state.fit.values.with_shared({name: -size}))
    share = (test.without.sse - other.sse) / test.sse_reduction
    if share < gates.DELAY_MIRRORED.threshold:
        return []
    opposite = quantity(-size, effect.parameters[0].unit)
    return [
        f"a delay of {opposite} explains {share:.0%} of that: the noise of an input is averaged between its samples"
    ]


def _early_beside_lag(state: State, effect: Effect) -> list[str]:
    """A caveat of a reading that comes early beside a lag of its own: no sensor reads ahead, and each of the two is as large as the other makes it. Of the lag, too, if half of it or more is made good."""
    delay, lag = f"{effect.reading}.delay", f"{effect.reading}.lag"
    shared = state.fit.values.shared
    if not effect.reading or not {delay, lag} <= set(state.fit.names) or shared[delay] >= 0.0:
        return []
    undone = -shared[delay] > gates.LAG_UNDONE.threshold * shared[lag]
    if not (delay in effect.names or (lag in effect.names and undone)):
        return []
    return [
        f"{effect.reading} comes early by {quantity(-shared[delay], 's')} beside a lag of {quantity(shared[lag], 's')}: together they are a filter that the library does not have"
    ]


def _own_reading(effect: Effect, test: DropOneTest) -> list[str]:
    """A caveat if the fault of a sensor helps every channel but its own; only of the finding itself, since rivals have no test."""
    ratio = test.error_ratio.get(effect.reading)
    if effect.name != test.effect or ratio is None or ratio < gates.OWN_READING.threshold:
        return []
    return [f"does not improve the prediction of {effect.reading}, the reading that it is to change"]


def _evidence(sse_reduction: float) -> str:
    """'evidence 37', 'no evidence': a loss is none, however large."""
    return f"evidence {sse_reduction:.0f}" if sse_reduction >= 0.5 else "no evidence"


Estimated = list[tuple[Parameter, f.Estimate]]
"""Amplitude parameters with value and interval."""


def _present(problem: Problem, effect: Effect, fitted: Fit, noise: Noise) -> Estimated:
    """Amplitude parameters less those that are absent for certain: of brakes that drag in front, the torque of the rear ones."""
    own = [(p, estimated(problem, p, fitted, noise)) for p in effect.amplitude_parameters]
    if effect.is_profile:
        return own
    largest = max(abs(e.value - p.value) / abs(p.typical) for p, e in own)

    def farthest(p: Parameter, e: f.Estimate) -> float:
        return max(abs(end - p.value) for end in (e.low or 0.0, e.high or 0.0)) / abs(p.typical)

    return [(p, e) for p, e in own if farthest(p, e) >= gates.ABSENT_PART.threshold * largest]


def _at_bounds(effect: Effect, fitted: Fit, present: Estimated) -> list[str]:
    """Amplitude parameters at a physical bound, or with intervals that reach it; for a profile only if all are. A fit at a bound would go on: something else is missing."""
    # a fit does not stop at a bound where small changes do nothing: a valve that is shut cannot be shut further
    stops = {
        p.name: p.lower if e.at_bound == "lower" else p.upper
        for p, e in present
        if e.at_bound and not flat.is_flat(p, fitted)
    }
    # a bound at the baseline is none: what ends there may be absent, which is said as such
    at_bound = [e for p, e in present if stops.get(p.name, p.value) != p.value]
    if at_bound and (not effect.is_profile or len(at_bound) == len(present)):
        first = at_bound[0]
        return [f"{first.name} stops at its physical bound, {quantity(first.value, first.unit)}"]
    # of physics a bound is where a law ends, and a size may come near it; a sensor that may be off by as much is not believed
    if effect.kind != "sensor":
        return []
    # by one fit of all recordings: where they disagree, their scatter does not make the bound a limit of what they show
    open_ends = [
        (e, bound)
        for p, e in present
        for bound, beyond in ((p.lower, p.lower - e.value), (p.upper, e.value - p.upper))
        if bound != p.value and beyond + SURE * fitted.sd(p.name) > 0.0
    ]
    return [
        f"the recordings leave open how large {e.name} is: its interval ends at its physical bound, {quantity(bound, e.unit)}"
        for e, bound in open_ends[:1]
    ]


def at_baseline(present: Estimated, fitted: Fit, effect: Effect) -> list[str]:
    """Amplitude parameters whose interval, at this shape, contains the baseline. Profiles are exempt."""
    if effect.is_profile:
        return []
    found = []
    variances = np.diag(inverse(shapes_held(effect, fitted)))
    held = dict(zip(effect.amplitude_names, np.sqrt(variances), strict=True))
    for p, e in present:
        sd = fitted.sd(p.name)
        low, high = e.low or 0.0, e.high or 0.0
        if sd > 0.0:
            # the side that no bound cuts off
            reach = max(high - e.value, e.value - low) * held[p.name] / sd
            undecided = abs(e.value - p.value) < gates.OFF_BASELINE.threshold * reach
        else:
            undecided = low <= p.value <= high
        if undecided:
            interval = f"{figures(low)} to {quantity(high, e.unit)}"
            found.append(
                f"{p.name} may be {quantity(p.value, p.unit)}, as in the baseline (95 %: {interval})"
            )
    return found


def _cancelled(problem: Problem, state: State, test: DropOneTest) -> list[str]:
    """Other findings that cancel the effect: the outputs hardly change when both are switched off (a lag and a negative delay)."""
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
    """Discrete parameters that fit best between their two values, so that neither value describes the recording."""
    found = []
    accepted = [problem.model.effect(name) for name in state.accepted]
    for p in [p for effect in accepted for p in effect.amplitude_parameters if in_between(p, fitted)]:
        off, on = figures(p.value), quantity(p.value + p.typical, p.unit)
        value = figures(fitted.values.shared[p.name])
        found.append(
            f"{p.name} can only be {off} or {on} and fits best at {value}: neither value describes the recording"
        )
    return found


def prior_conflicts(problem: Problem, fitted: Fit, noise: Noise) -> list[str]:
    """Prior conflicts as sentences: nuisances that the fit moved further than their priors allow, with all of their intervals."""
    found = []
    for p in [p for p in problem.model.nuisances if p.prior_sd is not None and p.name in fitted.names]:
        value = fitted.values.shared[p.name]
        distance = abs(value - p.value) / (p.prior_sd or 1.0)
        # the interval of the jackknife only where it decides: it costs more than everything else here
        far = distance > gates.PRIOR_CONFLICT.threshold and beyond_prior(p, estimate(p, fitted, noise))
        if far or estimate(p, fitted).at_bound is not None:
            pushed = quantity(value, p.unit, 4)
            found.append(
                f"the fit moved the nuisance {p.name} to {pushed}, {distance:.1f} standard deviations from its prior"
            )
    return found


def hangs_on(
    values: Sequence[f.BaselineValue], sheet: Problem, effect: Effect, fitted: Fit
) -> list[f.BaselineValue]:
    """Of values that contradict their sheet, those at whose sheet's edge the effect would change by more than its own size.

    A value that is wrong and an effect that is there only with it are two causes for what one unknown law may do.
    """
    found = []
    own, names, covariance = effect.amplitude_parameters, fitted.names, fitted.covariance
    typical = np.array([p.typical for p in own])
    size = np.array([fitted.values.shared[p.name] - p.value for p in own]) / typical
    for value in values:
        i = names.index(value.estimate.name)
        if value.away <= gates.PRIOR_CONFLICT.threshold or covariance[i, i] == 0.0:
            continue
        edge = edge_of_sheet(sheet.model.parameter(value.estimate.name), fitted.values)
        back = edge - fitted.values.shared[value.estimate.name]
        moved = covariance[[names.index(p.name) for p in own], i] / covariance[i, i] * back / typical
        if np.linalg.norm(moved) > gates.HANGS_ON_A_VALUE.threshold * np.linalg.norm(size):
            found.append(value)
    return found


def hanging(values: Sequence[f.BaselineValue], sheet: Problem, fitted: Fit) -> list[str]:
    """A caveat for each value on which an effect hangs."""
    found = []
    for value in values:
        name = value.estimate.name
        edge = quantity(edge_of_sheet(sheet.model.parameter(name), fitted.values), value.estimate.unit, 4)
        found.append(
            f"hangs on the baseline's {name}, which contradicts its sheet: with {edge}, the edge of what the sheet allows, its size would change by more than itself"
        )
    return found


def _superseded(
    problem: Problem, state: State, test: DropOneTest, shown: Effect, equation: OpenEnded
) -> list[str]:
    """A caveat if the effect's size depends on the open-ended equation: with it in the fit, less than half of the size is left.

    shown: the member of the group whose name is given.
    """
    effect = problem.model.effect(test.effect)
    if effect.size != 1 or not equation.terms:
        return []
    p = effect.parameters[0]
    whose = "its" if shown.name == effect.name else f"{effect.name}'s"
    size = state.fit.values.shared[p.name] - p.value
    shift, _ = equation.parameter_shifts[p.name]
    left = size + shift  # the effect's size when the equation is in the fit as well
    if left / size > gates.LEFT_BESIDE_EQUATION.threshold:
        return []
    before, after = figures(p.value + size), quantity(p.value + left, p.unit)
    return [f"beside {equation.equation()} {whose} {p.name} would change from {before} to {after}"]


def _changing_baseline(problem: Problem, state: State, test: DropOneTest, settings: Settings) -> list[str]:
    """A caveat if a baseline parameter with another value in some interval would explain as much as the temporary effect."""
    active = active_interval_of(problem.model.effect(test.effect), state.fit.values)
    assert active is not None
    rival = time_varying_nuisance(problem, state.noise, test.without, active)
    least = gates.NUISANCE_IN_TIME.threshold * test.sse_reduction - settings.same
    if rival is None or rival[1] < least:
        return []
    name, _, windows = rival
    ends = [(problem.windows[run.start], problem.windows[run.stop - 1]) for run in runs(problem, windows)]
    when = " and ".join(f"from {span(first.start_s, last.end_s)}" for first, last in ends)
    return [f"the nuisance {name} would explain as much with another value {when}"]
