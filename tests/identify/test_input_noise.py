"""The correction for noise of the inputs: what is left of information and score, against the scatter of estimates in errors-in-variables."""

import numpy as np
import pytest

from identify.machine.input_noise import reliable

PRIOR = np.diag([1.0, 4.0])
DATA = np.array([[9.0, 2.0], [2.0, 6.0]])


def test_without_noise_of_the_inputs_nothing_changes():
    score = np.array([0.3, -2.0])
    information, left = reliable(DATA, np.zeros((2, 2)), score, PRIOR)
    np.testing.assert_allclose(information, DATA, atol=1e-12)
    np.testing.assert_allclose(left, score, atol=1e-12)


def test_a_direction_that_is_all_noise_keeps_its_prior():
    data = np.diag([9.0, 6.0])
    information, left = reliable(data, np.diag([0.0, 6.5]), np.array([0.3, -2.0]), PRIOR)
    np.testing.assert_allclose(information, np.diag([9.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(left, [0.3, 0.0], atol=1e-12)


def test_the_information_is_that_of_the_scatter_of_estimates():
    """A line through points whose abscissa is measured with noise of the size of its own spread."""
    random = np.random.default_rng(1)
    true = random.normal(0.0, 1.0, 200)
    seen = true + random.normal(0.0, 1.0, (20_000, true.size))
    read = random.normal(0.0, 1.0, seen.shape)  # slope 0, unit noise
    naive, false = np.sum(seen**2, axis=1), float(true.size)
    estimates = np.sum(seen * read, axis=1) / (naive - false)
    information, _ = reliable(
        np.array([[float(np.mean(naive))]]), np.array([[false]]), np.zeros(1), np.eye(1)
    )
    assert 1.0 / information[0, 0] == pytest.approx(np.var(estimates), rel=0.1)
    # not by the information that is left alone: that would be half of the variance
    assert float(np.mean(naive)) - false > 1.8 * information[0, 0]
