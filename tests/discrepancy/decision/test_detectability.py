"""Effects in a valley with a nuisance: what a straight line counts as visible, and what a refit leaves of it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.sizes.detectability import in_a_valley, left_by_refit
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.model.description import Effect, Model, Parameter, Window
from discrepancy.selection.assess import assess
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Array, Recording, signal

FREQUENCY, SD = 1.5, 0.05


def swinging(beside: float) -> Model:
    """sin(w (1 + n + e) t): effect e is nuisance n, but for its share `beside` that comes with a cosine of its own."""

    def simulate(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
        t, e = window.time_s, values["stiffer"]
        own = beside * e * np.cos(5.0 * t)
        return {"place": np.sin(FREQUENCY * (1.0 + values["spring"] + e) * t) + own}

    spring = Parameter(name="spring", unit="1", lower=-0.5, upper=0.5, typical=0.01)
    stiffer = Parameter(name="stiffer", unit="1", lower=0.0, upper=0.5, typical=0.02)
    return Model(
        name="swing",
        sentence="",
        inputs={},
        outputs={"place": "m"},
        nuisances=(spring,),
        effects=(Effect(name="stiffer", sentence="", equation="", parameters=(stiffer,), kind="physics", place="spring"),),
        simulate=simulate,
        step_s=0.02,
        window_s=20.0,
    )  # fmt: skip


def recorded() -> Recording:
    t = 0.02 * np.arange(3000)
    place = np.sin(FREQUENCY * t) + np.random.default_rng(1).normal(0.0, SD, t.size)
    return Recording("swing", {"place": signal(t, place, "m")})


@pytest.mark.parametrize(("beside", "verdict"), [(0.0, "could not be judged"), (3.0, "ruled out")])
def test_only_what_no_nuisance_can_follow_is_ruled_out(beside: float, verdict: str) -> None:
    (candidate,) = examine(swinging(beside), [recorded()], Settings()).candidates
    assert candidate.verdict == verdict
    assert (candidate.power > 0.8) == (verdict == "ruled out")


def test_what_is_left_beside_a_line_is_followed_and_what_is_beside_the_valley_stays() -> None:
    """The cosine by itself has beside^2 typical^2 / 2 per reading, over the noise."""
    for beside in (0.0, 1.0, 3.0):
        problem = Problem(swinging(beside), [recorded()])
        state = assess(problem, (), problem.start(), Settings())
        effect, (score,) = problem.model.effects[0], state.scores
        assert score.power > 0.99
        assert in_a_valley(effect, score)
        expected = problem.measured.size * (beside * 0.02 / SD) ** 2 / 2.0 / score.variance_inflation
        assert left_by_refit(problem, state, effect, score) == pytest.approx(expected, rel=0.02, abs=0.01)


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        ("spring", "in these recordings nuisances imitate it completely; needs a storm"),
        ("force", "there is no usable force"),
    ],
)
def test_an_effect_without_trace_is_reported_with_what_it_would_need(place: str, reason: str) -> None:
    model = swinging(0.0)
    still = replace(model.effects[0], place=place, excited_by="a storm")

    def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
        seen = model.simulate(window, {**values, "stiffer": 0.0}, extra)
        return {**seen, "force": 0.0 * window.time_s}

    outputs = {**model.outputs, "force": "N"}
    blind = replace(model, simulate=simulate, effects=(still,), outputs=outputs)
    (candidate,) = examine(blind, [recorded()], Settings()).candidates
    assert (candidate.verdict, candidate.reason) == ("could not be judged", reason)
    assert (candidate.power, candidate.expected, candidate.smallest_detectable) == (0.0, [], [])
