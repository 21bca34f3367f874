"""A reading that drifts beside one that is off from a time on: where windows are few and the rest is not quite right, they look alike."""

from collections.abc import Iterator

from discrepancy.decision.groups import EXTRA_PARAMETER, RIVAL, fits_as_well
from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.problem import Problem, Windows
from discrepancy.model.description import Effect
from discrepancy.selection.active_intervals import restricted_to
from discrepancy.selection.assess import screen
from discrepancy.selection.screen import sensitivities
from discrepancy.selection.state import Settings, State
from discrepancy.signals.quantities import quantity, span

TRIED = 2  # times at which a step explains most to first order, and is fitted


def step_in_its_place(
    problem: Problem, state: State, without: Fit, effect: Effect, fitted: Fit, settings: Settings
) -> list[str]:
    """A caveat of a drift if a step of the same reading's bias explains as much; without: the fit without the drift, fitted: that with it."""
    bias = f"{effect.reading}.bias"
    if f"{effect.reading}.drift" not in effect.names or bias in fitted.names:
        return []
    offsets = [e for e in problem.model.effects if e.names == (bias,)]
    found = [s for offset in offsets for s in _steps(problem, state, without, offset, settings)]
    if not found:
        return []
    step, windows = min(found, key=lambda s: s[0].sse)
    # the time of the step is one parameter more
    if not fits_as_well(state.noise, without, fitted, step, EXTRA_PARAMETER, settings):
        return []
    acting = [problem.windows[i] for i in windows]
    when = span(min(w.start_s for w in acting), max(w.end_s for w in acting))
    size = quantity(step.values.shared[bias], problem.model.parameter(bias).unit, 2)
    how = "better" if step.sse + EXTRA_PARAMETER < fitted.sse else "as well"
    return [f"{effect.reading} off by {size} from {when} explains the recordings {how}"]


def _steps(
    problem: Problem, state: State, without: Fit, offset: Effect, settings: Settings
) -> Iterator[tuple[Fit, Windows]]:
    """Fits of a bias that acts from the start of some window on, at the likeliest times, and the windows in which it acts."""
    columns = sensitivities(problem, without.values, problem.predict(without.values), [offset])
    # from the first window on, the reading would be off throughout
    times_s = sorted({window.start_s for window in problem.windows})[1:]
    scored = []
    for time_s in times_s:
        windows = tuple(i for i, window in enumerate(problem.windows) if window.start_s >= time_s)
        (score,) = screen(problem, state.noise, without, restricted_to(problem, columns, windows), settings)
        scored.append((score, windows))
    scored.sort(key=lambda found: -found[0].raw_statistic)
    (parameter,) = offset.parameters
    for score, windows in scored[:TRIED]:
        begin = without.values.with_shared({parameter.name: parameter.value + float(score.change[0])})
        acting = begin.active_in(offset.amplitude_parameters, windows)
        yield fit(problem, state.noise, (*without.names, parameter.name), acting, effort=RIVAL), windows
