"""Operators with memory."""

import numpy as np
import pytest

from discrepancy.model.operators import play


def test_play_forgets_small_movements_and_follows_large_ones() -> None:
    x = np.array([0.0, 0.2, -0.2, 2.0, 1.8, -2.0])
    np.testing.assert_allclose(play(x, 0.5), [0.0, 0.0, 0.0, 1.5, 1.5, -1.5])


@pytest.mark.parametrize("size", [1, 2, 7, 300])
@pytest.mark.parametrize("width", [0.0, 0.7, 3.0, 1e3])
def test_play_is_moved_by_the_edge_of_its_dead_zone_alone(size: int, width: float) -> None:
    """Sample by sample: it moves no further than the edge that reaches it, and stands still between the edges."""
    x = np.random.default_rng(size).normal(size=size).cumsum()
    found, before = play(x, width), x[0]
    for value, now in zip(x, found, strict=True):
        if value - width > before:
            assert now == value - width
        elif value + width < before:
            assert now == value + width
        else:
            assert now == before
        before = now
