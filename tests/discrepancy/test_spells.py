"""Effects that act for a while: which are seen to, and what is said of those that are not found."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.account import candidates
from discrepancy.assess import assess
from discrepancy.problem import Problem
from discrepancy.recording import Recording, signal
from discrepancy.spells import for_a_while
from discrepancy.state import Settings, State
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
def test_what_acts_for_a_while_is_seen_whichever_probe_leads_over_the_whole_recording(seed: int) -> None:
    problem, state = assessed(seed)
    for probe in range(4):
        scores = [replace(s, probe=probe) for s in state.scores]
        found = for_a_while(problem, state.noise, state.fit, scores, state.columns, Settings().alpha)
        assert {(s.effect, windows) for s, windows in found} == {
            ("level delay", range(3, 6)),
            ("level lag", range(3, 6)),
        }


def test_what_seems_to_act_for_a_while_and_is_not_found_is_not_ruled_out() -> None:
    """Always acting it would have been noticed, which says nothing of this one."""
    problem, state = assessed(3)
    told = {c.effect: c for c in candidates(problem, state, state, [], Settings())}
    assert told["level delay"].power > 0.99
    assert told["level delay"].verdict == "not needed"
    assert "differs between stretches" in told["level delay"].reason
