"""Relaxation of the tyres of the small car."""

import numpy as np

from discrepancy.model.sensors import lagged
from discrepancy.models import car


def test_a_vanishing_relaxation_length_changes_nothing_and_a_long_one_is_a_lag_of_length_over_speed() -> None:
    time_s = 0.01 * np.arange(2000)
    yaw_rate, speed = np.sin(3.0 * time_s), np.full(time_s.size, 1.3)
    np.testing.assert_allclose(car._relaxed(yaw_rate, speed, 1e-6, 0.01), yaw_rate, atol=1e-5)
    relaxed = car._relaxed(yaw_rate, speed, 0.13, 0.01)
    np.testing.assert_allclose(relaxed, lagged(yaw_rate, 0.1, 0.01), atol=1e-3)
