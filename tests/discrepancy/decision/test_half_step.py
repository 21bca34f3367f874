"""A step of the model that is too coarse, and what its error would be taken for."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.caveats import of_the_step
from discrepancy.decision.sizes.half_step import HalfStep, at_half_step
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.model.description import Model, Window
from discrepancy.selection.assess import assess
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Array
from tests.discrepancy.toys import record, tank

QUICK = Settings(open_ended=False)


def by_euler(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    """The tank in explicit steps: what it loses in one is of the level at its beginning."""
    level, levels = values["level"], []
    rate = 0.2 + values.get("leak", 0.0)
    for inflow in window["inflow"].tolist():
        levels.append(level)
        level += window.step_s * (inflow / values["area"] - rate * level)
    return {"level": np.array(levels) + values.get("offset", 0.0)}


def euler(*effects: str, step_s: float) -> Model:
    known = replace(tank().nuisances[0], prior_sd=0.002)
    return replace(tank(*effects), simulate=by_euler, step_s=step_s, nuisances=(known, tank().nuisances[1]))


def halved(model: Model, seed: int) -> HalfStep:
    problem = Problem(model, [record(seed, noise=0.01)])
    state = assess(problem, (), problem.start(), QUICK)
    found = at_half_step(problem, state.noise, state.fit)
    assert found is not None
    return found


def test_an_exact_integration_is_the_same_at_half_of_its_step() -> None:
    assert halved(tank("leak"), 1).evidence < 1e-6


def test_halving_an_explicit_step_again_halves_what_it_changes() -> None:
    """First order: the squared change falls to a quarter."""
    coarse, fine = halved(euler("leak", step_s=0.1), 1), halved(euler("leak", step_s=0.05), 1)
    assert coarse.evidence / fine.evidence == pytest.approx(4.0, rel=0.1)


def test_what_small_steps_would_change_is_what_they_change() -> None:
    """By explicit steps of 0.1 s a leak of 0.1 1/s is 4 % too small, by exact ones it is right to 0.5 %."""
    drive = record(1, noise=0.001, leak=0.1)
    sizes = {}
    for name, model in (
        ("explicit", euler("leak", step_s=0.1)),
        ("exact", replace(euler("leak", step_s=0.1), simulate=tank().simulate)),
    ):
        problem = Problem(model, [drive])
        state = assess(problem, ("leak",), problem.start(), QUICK)
        sizes[name] = state.fit.values.shared["leak"]
        if name == "explicit":
            half = at_half_step(problem, state.noise, state.fit)
    assert half is not None
    off = sizes["exact"] - sizes["explicit"]
    assert sizes["exact"] == pytest.approx(0.1, rel=0.01)
    assert half.shifts["leak"] == pytest.approx(off, rel=0.2)


def test_an_error_of_the_integration_is_no_effect() -> None:
    """An explicit step of 0.4 s loses 4 % of the outflow's rate."""
    result = examine(euler("leak", "level delay", step_s=0.4), [record(1, noise=0.01)], QUICK)
    assert result.named == []
    assert any("is coarse: with half of it" in reason for reason in result.reasons)


@pytest.mark.parametrize(
    ("shift", "evidence", "share", "doubted"),
    [
        (-0.04, 50.0, 0.01, True),
        (-0.01, 50.0, 0.01, False),
        (-0.04, 5.0, 0.01, False),  # nobody would see it
        (-0.04, 1e6, 0.5, False),  # not integration, but a model that counts in steps
    ],
)
def test_a_size_that_hangs_on_the_step_is_none(
    shift: float, evidence: float, share: float, doubted: bool
) -> None:
    problem = Problem(tank("leak"), [record(1, leak=0.05)])
    state = assess(problem, ("leak",), problem.start(), QUICK)
    size = state.fit.values.shared["leak"]
    half = HalfStep(evidence, "level", share, {"leak": shift * size / 0.05})
    found = of_the_step(problem, state, problem.model.effects[0], half)
    assert bool(found) is doubted


def test_an_effect_much_larger_than_that_error_keeps_its_name() -> None:
    result = examine(euler("leak", "level delay", step_s=0.1), [record(1, noise=0.01, leak=0.1)], QUICK)
    assert "leak" in result.named


def test_a_model_that_counts_in_steps_is_asked_about() -> None:
    def counting(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
        return by_euler(replace(window, step_s=0.1), values, extra)

    found = halved(replace(euler("leak", step_s=0.1), simulate=counting), 1)
    assert not found.of_integration
    [said] = found.said(0.1)
    assert said.endswith("does `simulate` use `window.step_s`?")


def test_an_expensive_model_is_not_simulated_for_it() -> None:
    problem = Problem(replace(tank("leak"), jacobian_reach=0.5), [record(1)])
    state = assess(problem, (), problem.start(), QUICK)
    assert at_half_step(problem, state.noise, state.fit) is None
