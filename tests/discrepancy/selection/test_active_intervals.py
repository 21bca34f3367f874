"""Effects that act for a while: which are seen to, and what is said of those that are not found."""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from discrepancy.decision.summary import candidates
from discrepancy.estimation.problem import Problem
from discrepancy.selection.active_intervals import (
    FEWEST_WINDOWS,
    MOST_RANGES,
    _evenness,
    best_ranges,
    temporary_effects,
)
from discrepancy.selection.assess import assess
from discrepancy.selection.state import Settings, State
from discrepancy.signals.recording import Recording, signal
from tests.discrepancy.toys import record, tank


def late_from_60_to_120_s(seed: int) -> Recording:
    """A level that is read 0.6 s late for 60 of 200 s."""
    good, late = record(seed, duration_s=200.0), record(seed, duration_s=200.0, delay_s=0.6)
    time_s = good.signals["level"].time_s
    acting = (time_s >= 60.0) & (time_s < 120.0)
    level = np.where(acting, late.signals["level"].value, good.signals["level"].value)
    return replace(good, signals={**good.signals, "level": signal(time_s, level, "m")})


def assessed(seed: int) -> tuple[Problem, State]:
    problem = Problem(tank("level delay", "level lag"), [late_from_60_to_120_s(seed)])
    return problem, assess(problem, (), problem.start(), Settings())


@pytest.mark.parametrize("seed", [0, 3])
def test_a_temporary_effect_is_seen_whichever_trial_step_scores_best_over_all(seed: int) -> None:
    problem, state = assessed(seed)
    for trial_step in range(4):
        scores = [replace(s, trial_step=trial_step) for s in state.scores]
        found = temporary_effects(problem, state.noise, state.fit, scores, state.columns, Settings().alpha)
        assert {(s.effect, windows) for s, windows in found} == {
            ("level delay", (3, 4, 5)),
            ("level lag", (3, 4, 5)),
        }


def test_a_possible_temporary_effect_is_not_ruled_out() -> None:
    """Always acting it would have been noticed, which says nothing of this one."""
    problem, state = assessed(3)
    by_name = {c.effect: c for c in candidates(problem, state, state, [], Settings())}
    assert by_name["level delay"].power > 0.99
    assert by_name["level delay"].verdict == "not needed"
    assert "blocks of time disagree on its size" in by_name["level delay"].reason


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("least", [0.5, 3.0, 20.0])
def test_the_ranges_are_the_best_of_all_choices(seed: int, least: float) -> None:
    """Against every choice of up to four ranges among 12 windows, tried one by one."""
    reduction = np.random.default_rng(seed).normal(0.0, 2.0, 12)
    count = reduction.size
    among = [
        range(first, stop)
        for first in range(count)
        for stop in range(first + FEWEST_WINDOWS, count + 1)
        if stop - first <= count - FEWEST_WINDOWS
    ]

    def gained(choice: tuple[range, ...]) -> float:
        return float(sum(reduction[list(one)].sum() for one in choice)) - least * (len(choice) - 1)

    def apart(choice: tuple[range, ...]) -> bool:
        ordered = sorted(choice, key=lambda one: one.start)
        return all(a.stop < b.start for a, b in pairwise(ordered))

    possible = [
        choice
        for number in range(1, MOST_RANGES + 1)
        for choice in combinations(among, number)
        if apart(choice)
    ]
    found = best_ranges(reduction, among, least)
    best = max(possible, key=gained)
    windows = tuple(sorted(w for one in best for w in one))
    if len(windows) <= count - FEWEST_WINDOWS:
        assert found == windows
    else:  # too few would be left outside: fewer ranges
        assert len(found) <= count - FEWEST_WINDOWS
        assert reduction[list(found)].sum() >= max(gained((one,)) for one in among) - 1e-9


@pytest.fixture(scope="module")
def rows() -> State:
    """A state with ten windows of 200 rows."""
    return assessed(0)[1]


INSIDE = np.isin(np.arange(10), [3, 4, 5, 6])


def evenness(state: State, size_of_window: np.ndarray, scatter: float, seed: int) -> float:
    """Of an effect of unit sensitivity, with these sizes by window beside the fitted one, under innovations of this size.

    In each window the error has a share that stays, as another missing effect has: its sums scatter more than those of white innovations.
    """
    rng, noise = np.random.default_rng(seed), state.noise
    count = noise.row_window.size
    stays = scatter * rng.normal(0.0, np.sqrt(noise.window_count / count), noise.window_count)
    residual = rng.normal(0.0, 1.0, count) + (size_of_window + stays)[noise.row_window]
    return _evenness(noise, np.ones(count), residual, INSIDE)


@pytest.mark.parametrize("scatter", [0.0, 3.0])
def test_an_even_effect_is_called_uneven_as_rarely_as_is_asked_for(rows: State, scatter: float) -> None:
    """Whether or not something else is missing too, inside and outside alike: of 400 at most 5 % with 3 standard deviations."""
    found = np.array([evenness(rows, 0.0 * INSIDE, scatter, seed) for seed in range(400)])
    assert np.mean(found < 0.05) < 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 400)


def test_an_effect_that_comes_and_goes_within_its_interval_is_uneven(rows: State) -> None:
    """Half of its windows have it twice and half not at all, each with lambda 200; the search asks for 2 % over its candidates."""
    sizes = np.array([0.0, 0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 0.0, 0.0, 0.0])
    assert max(evenness(rows, sizes, 0.0, seed) for seed in range(20)) < Settings().alpha / 12


def test_one_window_alone_shows_no_evenness(rows: State) -> None:
    noise = rows.noise
    direction = np.where(np.isin(noise.row_window, [4]) | ~INSIDE[noise.row_window], 1.0, 0.0)
    assert _evenness(noise, direction, np.zeros(direction.size), INSIDE) == 0.0
