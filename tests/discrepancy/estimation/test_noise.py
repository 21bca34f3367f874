"""Whitening by an autoregression."""

import numpy as np
import pytest

from discrepancy.estimation.autoregression import autoregression, memory_limited
from discrepancy.estimation.noise import estimate_noise
from discrepancy.estimation.problem import Problem
from discrepancy.model.windows import Block
from tests.discrepancy.toys import record, tank


def test_whitening_leaves_unit_white_innovations() -> None:
    problem = Problem(tank(), [record(11, memory=0.7)])
    residual = np.random.default_rng(1).normal(size=problem.measured.size)
    for i in range(1, residual.size):
        residual[i] += 0.7 * residual[i - 1]
    noise = estimate_noise(problem, residual, 0.0)
    white = noise.whiten(residual)
    assert np.std(white) == pytest.approx(1.0, abs=0.05)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.1
    assert noise.whiteners[0].past[0, 0, 0] == pytest.approx(0.7, abs=0.08)


def test_channels_too_many_to_be_coupled_keep_their_own_memory() -> None:
    """Thirty oscillations of their own in 300 rows: a coupled order would take 900 numbers, and leave them as they are."""
    n, c, rng = 300, 30, np.random.default_rng(3)
    rows = rng.standard_normal((n, c))
    own = 2.0 * 0.9 * np.cos(np.linspace(0.3, 2.5, c))
    for k in range(2, n):
        rows[k] += own * rows[k - 1] - 0.81 * rows[k - 2]
    block = Block(0, 0, tuple(f"y{i}" for i in range(c)), 0.04 * np.arange(n), 0)
    whitener = autoregression([block], rows.ravel(), 1.0, np.zeros(c))
    white = whitener.apply(rows[:, :, None])[:, :, 0]
    correlation = np.sum(white[1:] * white[:-1], axis=0) / np.sum(white**2, axis=0)
    assert np.sqrt(np.mean(correlation**2)) < 2.0 / np.sqrt(n)
    assert white.var() == pytest.approx(1.0, rel=0.1)


def test_an_integratingautoregression_is_made_to_forget() -> None:
    past = memory_limited(np.array([[[1.0]]]), samples=100)
    assert past[0, 0, 0] == pytest.approx(0.96)
    assert memory_limited(np.array([[[0.5]]]), samples=100)[0, 0, 0] == 0.5
