"""Effects that act for a while: which are seen to, and what is said of those that are not found."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.summary import candidates
from discrepancy.estimation.problem import Problem
from discrepancy.selection.active_intervals import temporary_effects
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
            ("level delay", range(3, 6)),
            ("level lag", range(3, 6)),
        }


def test_a_possible_temporary_effect_is_not_ruled_out() -> None:
    """Always acting it would have been noticed, which says nothing of this one."""
    problem, state = assessed(3)
    by_name = {c.effect: c for c in candidates(problem, state, state, [], Settings())}
    assert by_name["level delay"].power > 0.99
    assert by_name["level delay"].verdict == "not needed"
    assert "blocks of time disagree on its size" in by_name["level delay"].reason
