"""Error budgets of channels: each source by its law."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from discrepancy.checks.budgets import budgets, resolution
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Model, Parameter
from discrepancy.signals.recording import Recording, signal
from tests.discrepancy.toys import record, tank


def still(noise: np.ndarray, *, step_s: float = 0.1) -> Problem:
    """A reading that the model predicts to be zero, and an input that always moves."""
    time_s = step_s * np.arange(noise.size)
    model = Model(
        name="zero", sentence="", inputs={"push": "1"}, outputs={"level": "m"}, effects=(), step_s=step_s,
        nuisances=(Parameter(name="nothing", unit="m", prior_sd=1.0),),
        simulate=lambda window, _, __: {"level": np.zeros(window.time_s.size)},
    )  # fmt: skip
    signals = {"push": signal(time_s, np.sin(time_s), "1"), "level": signal(time_s, noise, "m")}
    return Problem(model, [Recording("r", signals)])


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9, 0.99])
def test_no_stationary_noise_has_one_step_errors_beyond_its_differences(memory: float) -> None:
    """Of AR(1) noise with innovations of size s the differences have s sqrt(2 / (1 + a)), by theory: between s and 1.41 s."""
    white = np.random.default_rng(1).normal(0.0, 0.3, 20_000)
    problem = still(lfilter([1.0], [1.0, -memory], white))
    found = budgets(problem, problem.measured)["level"]
    assert found.source == "differences"
    assert found.value == pytest.approx(0.3 * np.sqrt(2.0 / (1.0 + memory)), rel=0.03)


def test_contacts_and_outliers_are_errors_and_no_noise() -> None:
    noise = np.random.default_rng(2).normal(0.0, 0.1, 5_000)
    struck = noise.copy()
    struck[1000:1100] += np.random.default_rng(3).normal(0.0, 5.0, 100)
    calm, hit = (budgets(p, p.measured)["level"].value for p in (still(noise), still(struck)))
    assert hit == pytest.approx(calm, rel=0.1)


def test_resolution_is_the_step_of_a_code_and_continuous_readings_have_none() -> None:
    values = np.random.default_rng(4).normal(0.0, 1.0, 3_000)
    assert resolution(np.round(values / 0.05) * 0.05 * 3.6) == pytest.approx(0.18, rel=1e-6)
    assert resolution(values) == 0.0


def test_a_coarse_reading_has_half_a_step() -> None:
    """A value that moves over a code in many samples hides its noise: differences are mostly zero."""
    slow = np.round(np.sin(np.linspace(0.0, 12.0, 4_000)) / 0.2) * 0.2
    problem = still(slow)
    found = budgets(problem, problem.measured)["level"]
    assert (found.source, found.value) == ("resolution", pytest.approx(0.1))


@pytest.mark.parametrize(("push", "source"), [(0.0, "standstill"), (1.0, "differences")])
def test_the_scatter_at_standstill_counts_where_it_is_larger(push: float, source: str) -> None:
    """Slow noise has small differences; at rest all of it shows. Where an input moves all the time, nothing is at rest."""
    slow = lfilter([1.0], [1.0, -0.97], np.random.default_rng(5).normal(0.0, 0.01, 4_000))
    motion = np.where(np.arange(4_000) < 2_000, 0.0, 3.0 * np.sin(0.01 * np.arange(4_000)))
    problem = still(slow + motion)
    driven = problem.windows[0].time_s >= 200.0
    command = np.where(driven, np.sin(problem.windows[0].time_s), push * np.cos(problem.windows[0].time_s))
    problem.windows[:] = [replace(w, known={**w.known, "push": command}) for w in problem.windows]
    found = budgets(problem, slow)["level"]
    assert found.source == source
    if source == "standstill":
        assert found.value == pytest.approx(float(np.std(slow[:2_000])), rel=0.01)


def test_a_steady_motion_under_a_constant_input_is_no_standstill() -> None:
    turning = np.sin(0.7 * np.arange(4_000))
    problem = still(turning)
    problem.windows[:] = [replace(w, known={"push": np.zeros(w.time_s.size)}) for w in problem.windows]
    noise = np.random.default_rng(6).normal(0.0, 0.01, 4_000)
    assert budgets(problem, noise)["level"].source == "differences"


def test_a_sheet_is_taken_at_its_word() -> None:
    model = replace(tank(), sensor_noise={"level": 0.004}, floors={"level": 0.003})
    problem = Problem(model, [record(1)])
    found = budgets(problem, np.zeros(problem.measured.size))["level"]
    assert (found.source, found.value) == ("sensor sheet", pytest.approx(0.005))
