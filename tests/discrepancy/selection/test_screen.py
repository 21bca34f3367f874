"""Scores, thresholds and directions of the screen."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Parameter
from discrepancy.model.sensors import sensor_effects
from discrepancy.selection.screen import Columns, collinearity, penalty, score
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings
from tests.discrepancy.toys import record, tank

STRICT = Settings()


def test_screen_costs_no_more_than_one_simulation_per_probe() -> None:
    problem = Problem(tank(), [record(12)])
    search(problem, replace(STRICT, shortlist=0))
    parameters = len(problem.model.parameters)
    assert problem.simulations <= 6 * parameters + 50


def test_more_candidates_need_more_evidence() -> None:
    assert penalty(1, 40, 0.02) > penalty(1, 4, 0.02) > penalty(1, 4, 0.1)
    assert penalty(3, 10, 0.02) > penalty(1, 10, 0.02)


def test_collinearity_does_not_depend_on_scale_and_vanishes_at_right_angles() -> None:
    a, b = np.array([[1.0], [0.0], [0.0]]), np.array([[0.0], [2.0], [0.0]])
    assert collinearity(a, 7.0 * a) == pytest.approx(1.0)
    assert collinearity(a, b) == pytest.approx(0.0)


def test_the_nearest_probe_is_the_one_that_leaves_least_whatever_the_slope_at_another() -> None:
    """Nearly no change points the right way and goes no way; a finite one goes most of it."""
    effect = sensor_effects("y", "1", bias=1.0, kinds=("delay",))[0]
    residual, raw = (
        np.array([1.0, 1.0, 0.0]),
        (np.array([[0.02], [0.02], [0.0]]), np.array([[1.0], [1.0], [1.0]])),
    )
    columns = Columns(effect, raw, (np.array([0.001]), np.array([0.05])))
    seen = [(X, float(np.sum(X**2))) for X in raw]
    found = score(columns, seen, residual, 10.0, np.arange(3))
    assert (found.trial_step, found.nearest) == (0, 1)


def test_an_effect_of_which_one_combination_is_hidden_could_not_be_judged() -> None:
    """Front and rear show by their difference only: both alike would go unnoticed, so 'ruled out' would be wrong."""
    ends = tuple(Parameter(name=f"pressure.{end}", unit="bar", typical=0.4) for end in ("front", "rear"))
    effect = replace(sensor_effects("y", "1", bias=1.0, kinds=("bias",))[0], parameters=ends)
    one, other = np.random.default_rng(1).normal(size=(2, 4000))
    change = np.array([0.4, 0.4])
    for raw, visible in (
        (np.stack([one, other], axis=1), True),
        (np.stack([one, 1e-3 * other - one], axis=1), False),
    ):
        found = score(
            Columns(effect, (raw,), (change,)),
            [(raw, float(np.sum(raw**2)))],
            0.0 * one,
            20.0,
            np.arange(4000) % 5,
        )
        assert (found.power > 0.99) == visible
        assert found.power > 0.0
