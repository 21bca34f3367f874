"""What held-out rows have to confirm, against the chance that a true effect has of doing so."""

import numpy as np
import pytest

from discrepancy.selection.state import Settings


@pytest.mark.parametrize("rows", [25.0, 60.0, 250.0])
def test_a_true_effect_is_confirmed_but_for_three_in_a_hundred(rows: float) -> None:
    """Score z of two halves with unit variance each, fitted on one and judged on the other, both ways."""
    settings, rng = Settings(), np.random.default_rng(1)
    true = np.sqrt(rows / 2.0)  # of each half: all rows have a squared size of `rows`
    a, b = true + rng.normal(size=(2, 20_000))
    gain = (a + b) ** 2 / 2.0
    held_out = (a**2 - (a - b) ** 2) + (
        b**2 - (a - b) ** 2
    )  # each half's own error without, and with the size of the other
    passed = np.array([h > settings.least_held_out(g) for g, h in zip(gain, held_out, strict=True)])
    assert np.mean(passed) > 0.97


def test_a_gain_far_beyond_chance_has_to_be_there_on_held_out_rows_by_its_share() -> None:
    settings = Settings(held_out=4.0, confirmed=0.3)
    assert settings.least_held_out(15.0) == 4.0
    assert settings.least_held_out(10_000.0) == pytest.approx(3000.0 - 200.0)
