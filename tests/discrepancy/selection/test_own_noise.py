"""Effects that the noise of the search hides."""

import pytest

from bench.proof import wild
from bench.proof.arm import read
from discrepancy.estimation.fit import fit
from discrepancy.estimation.problem import Problem
from discrepancy.selection import own_noise
from discrepancy.selection.own_noise import under_own_noise
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings
from tests.discrepancy.estimation.test_fit import pushed, sledge
from tests.discrepancy.toys import record, tank

SETTINGS = Settings()


@pytest.mark.parametrize("seed", range(3))
def test_an_effect_is_seen_better_under_the_noise_that_it_leaves(seed: int) -> None:
    """Of dry friction that stops a sledge, first order explains little. The rest counts as noise in the search.

    The fit ends where one ends that begins at the truth.
    """
    problem = Problem(sledge(), [pushed(seed)])
    baseline = search(problem, SETTINGS)[1][0]
    (seen,) = baseline.trials
    (found,) = under_own_noise(problem, baseline, SETTINGS)
    assert (seen.effect, found.effect) == ("dry friction", "dry friction")
    assert found.reference is not None
    true = fit(problem, found.reference.noise, ("dry",), problem.start().having(dry=4.0))
    assert found.fit.values.shared["dry"] == pytest.approx(
        true.values.shared["dry"], abs=3.0 * true.sd("dry")
    )
    (left,) = found.reference.noise.innovation_sd(problem).values()
    (taken,) = baseline.noise.innovation_sd(problem).values()
    assert left < taken
    assert found.sse_reduction > seen.sse_reduction


def test_an_effect_that_makes_the_recordings_no_likelier_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Under the noise of one model, the other is judged too hard; only likelihoods under noises of their own compare both."""
    problem = Problem(sledge(), [pushed(0)])
    baseline = search(problem, SETTINGS)[1][0]
    assert under_own_noise(problem, baseline, SETTINGS)
    monkeypatch.setattr(own_noise, "log_likelihood", lambda *_: 0.0)
    assert under_own_noise(problem, baseline, SETTINGS) == []


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("leak", [0.0, 0.05])
def test_what_helps_a_little_is_not_hidden(seed: int, leak: float) -> None:
    """A late pump is not in the library. A level scale takes over a part of its error and would pass all other tests; it takes far less than half."""
    problem = Problem(tank("leak", "level scale"), [record(seed, leak=leak, pump_lag_s=0.6, noise=0.005)])
    state, _ = search(problem, SETTINGS)
    assert under_own_noise(problem, state, SETTINGS) == []


@pytest.mark.slow
def test_a_strong_resistance_is_named_beside_foreign_laws() -> None:
    """Ten times the typical size, a wheel out of round and a speed that wanders: the search alone had found nothing, with errors ten times over budget."""
    [arm] = [arm for arm in wild.arms("wild straight", wild.SEEDS["tuning"]) if arm.seed == 101_038]
    found = read(wild.carried_out(arm)).findings
    assert found.named == ["rolling resistance"]
