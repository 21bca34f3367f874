"""Two findings that one effect explains better, each in its place, become that one."""

from collections.abc import Mapping

import numpy as np

from discrepancy.decision.again.namesakes import apart, without_namesakes
from discrepancy.decision.drop_one import drop_one_tests
from discrepancy.decision.groups import Alternative
from discrepancy.decision.judge import alternatives_of
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.problem import Problem, Values
from discrepancy.model import Array, Effect, Model, Parameter, Recording, Window, signal
from discrepancy.selection.assess import assess
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.state import Settings, State

SETTINGS = Settings(open_ended=False)
TIME_S = 0.05 * np.arange(2400)
# "early" and "late" each hold one half of what "whole" does, and something that is not there
SHAPES = {
    "whole": np.sin(0.9 * TIME_S) + np.cos(2.3 * TIME_S),
    "early": np.sin(0.9 * TIME_S) + 0.3 * np.sin(5.0 * TIME_S),
    "late": np.cos(2.3 * TIME_S) + 0.3 * np.cos(7.0 * TIME_S),
}


def model() -> Model:
    def simulate(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
        moved = sum(values.get(name, 0.0) * np.interp(window.time_s, TIME_S, s) for name, s in SHAPES.items())
        return {"angle": window["demand"] + moved}

    return Model(
        name="toy",
        sentence="an angle that follows its demand",
        inputs={"demand": "rad"},
        outputs={"angle": "rad"},
        effects=tuple(
            Effect(
                name=name,
                sentence=name,
                equation="",
                parameters=(Parameter(name=name, unit="rad", lower=-5.0, upper=5.0, typical=0.5),),
                kind="physics",
                place="joint",
            )
            for name in SHAPES
        ),
        simulate=simulate,
        step_s=0.05,
        window_s=10.0,
    )


def judged(accepted: tuple[str, ...]) -> State | None:
    """The state in the place of one in which these effects were accepted."""
    rng = np.random.default_rng(5)
    angle = SHAPES["whole"] + rng.normal(0.0, 0.5, TIME_S.size)
    signals = {"demand": signal(TIME_S, 0.0 * TIME_S, "rad"), "angle": signal(TIME_S, angle, "rad")}
    problem = Problem(model(), [Recording("day", signals)])
    state = assess(problem, accepted, problem.start(), SETTINGS)
    tests = drop_one_tests(problem, state, {}, OpenEnded(), SETTINGS)
    rivals = [alternatives_of(problem, state, test, SETTINGS) for test in tests]
    return without_namesakes(problem, state, rivals, SETTINGS)


def test_two_effects_that_one_replaces_become_that_one() -> None:
    state = judged(("early", "late"))
    assert state is not None
    assert state.accepted == ("whole",)
    assert abs(state.fit.values.shared["whole"] - 1.0) < 0.1


def test_effects_of_different_names_stay() -> None:
    assert judged(("whole",)) is None


def ranked(*members: tuple[str, float]) -> list[Alternative]:
    """A finding's alternatives: name, and difference in SSE from what was accepted."""
    fitted = Fit((), Values({}, {}), 0.0, 0.0, np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)))
    return [Alternative(name, difference, 1.0, fitted) for name, difference in members]


def test_no_two_findings_have_one_name() -> None:
    """A delay of the unit is the best name of both; it stays with the finding that it improves more."""
    front, rear = ranked(("unit", -8.0), ("front", 0.0)), ranked(("unit", -3.0), ("rear", 0.0), ("hub", 2.0))
    assert [[a.effect for a in found] for found in apart([front, rear])] == [
        ["unit", "front"],
        ["rear", "hub"],
    ]
    assert [[a.effect for a in found] for found in apart([rear, ranked(("front", 0.0), ("unit", 1.0))])] == [
        ["unit", "rear", "hub"],
        ["front", "unit"],
    ]
