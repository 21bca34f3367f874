"""A curve that a fold of the data does not know decides about no other effect."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision import drop_one
from discrepancy.decision.drop_one import DropOneTest, drop_one_tests
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Model, Parameter, Window
from discrepancy.selection.assess import assess
from discrepancy.selection.candidate_fits import held_out_residual, try_shortlist
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.state import Settings, State
from discrepancy.signals.recording import Array, Recording, signal
from tests.discrepancy.toys import STEP_S, simulate, tank

SETTINGS = Settings()
KNOTS = (0.0, 0.5, 1.0, 1.5, 4.0)
DELAY_S = 0.2


def curve(inflow: Array, values: Mapping[str, float]) -> Array:
    """Inflow beyond the measured one, straight between the knots."""
    at_knots = [values.get(f"curve.at_{i}", 0.0) for i in range(len(KNOTS))]
    return np.interp(inflow, KNOTS, at_knots)


def curved(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    return simulate(window, values, {**extra, "inflow": curve(window["inflow"], values)})


def model() -> Model:
    knots = tuple(
        Parameter(name=f"curve.at_{i}", unit="m/s", lower=-2.0, upper=2.0, typical=0.1)
        for i in range(len(KNOTS))
    )
    plain = tank("level delay")
    own = Effect(
        name="curve",
        sentence="a curve of the inflow",
        equation="",
        parameters=knots,
        kind="physics",
        place="tank",
        excited_by="filling",
    )
    return replace(plain, effects=(own, *plain.effects), simulate=curved, ports=())


def assessed(seed: int, accepted: tuple[str, ...] = ("curve", "level delay")) -> tuple[Problem, State]:
    """With effects accepted of a curve and a delay, both true. The largest inflow comes in one window; elsewhere it hardly exceeds the last knot but one."""
    rng, rows = np.random.default_rng(seed), 1200
    inflow = np.repeat(rng.uniform(0.0, 1.55, rows // 25), 25)
    inflow[450:500] = 4.0
    true = {f"curve.at_{i}": 0.1 * knot for i, knot in enumerate(KNOTS)}
    fine = np.repeat(inflow + curve(inflow, true), 10)
    level, out, h = 0.5, np.empty(fine.size), STEP_S / 10
    for i, u in enumerate(fine.tolist()):
        out[i] = level
        level += h * (u - 0.2 * level)
    time_s = STEP_S * np.arange(rows)
    seen = np.interp(time_s - DELAY_S, h * np.arange(fine.size), out) + rng.normal(0.0, 0.02, rows)
    recording = Recording(
        "tank", {"inflow": signal(time_s, inflow, "m/s", held=True), "level": signal(time_s, seen, "m")}
    )
    problem = Problem(model(), [recording])
    start = problem.start().with_shared(
        {**true, "level.delay": DELAY_S if "level delay" in accepted else 0.0}
    )
    return problem, assess(problem, accepted, start, SETTINGS)


def drop_one_of(seed: int) -> dict[str, DropOneTest]:
    problem, state = assessed(seed)
    return {t.effect: t for t in drop_one_tests(problem, state, {}, OpenEnded(), SETTINGS)}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_curve_that_a_fold_does_not_know_decides_about_no_other_effect(seed: int) -> None:
    delay = drop_one_of(seed)["level delay"]
    assert delay.held_out_sse_reduction == pytest.approx(delay.data_sse_reduction, rel=0.2)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nor_does_it_in_the_search(seed: int) -> None:
    problem, state = assessed(seed, accepted=("curve",))
    (delay,) = [t for t in try_shortlist(problem, state, SETTINGS) if t.effect == "level delay"]
    assert delay.held_out_sse_reduction == pytest.approx(delay.raw_sse_reduction, rel=0.2)


def test_the_test_of_a_curve_itself_does_not_hold_it(monkeypatch) -> None:
    """Else held-out data would say nothing about it."""
    problem, state = assessed(1)
    asked = []

    def watched(*given, held=(), **options):
        asked.append((given[2], tuple(held)))
        return held_out_residual(*given, held=held, **options)

    monkeypatch.setattr(drop_one, "held_out_residual", watched)
    drop_one_tests(problem, state, {}, OpenEnded(), SETTINGS)
    both = ("curve", "level delay")
    assert asked == [(both, ()), (("level delay",), ()), (both, ("curve",)), (("curve",), ("curve",))]
