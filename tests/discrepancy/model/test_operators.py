"""Operators with memory."""

import numpy as np

from discrepancy.model.operators import play


def test_play_forgets_small_movements_and_follows_large_ones() -> None:
    x = np.array([0.0, 0.2, -0.2, 2.0, 1.8, -2.0])
    np.testing.assert_allclose(play(x, 0.5), [0.0, 0.0, 0.0, 1.5, 1.5, -1.5])
