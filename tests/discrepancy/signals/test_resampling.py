"""What signals are between their samples."""

import numpy as np
import pytest

from discrepancy.signals.recording import Array, Signal, signal
from discrepancy.signals.resampling import course, is_smooth, resampled

GRID = np.linspace(0.0, 20.0, 4001)


def hand(time_s: Array) -> Array:
    """A smooth movement."""
    return np.sin(time_s) + 0.4 * np.sin(2.3 * time_s + 0.5)


def sampled(every_s: float, noise: float = 0.0) -> Signal:
    stamps = np.arange(0.0, 20.0 + 0.5 * every_s, every_s)
    value = hand(stamps) + noise * np.random.default_rng(1).normal(size=stamps.size)
    return signal(stamps, value, "rad")


def test_errors_between_samples_of_a_smooth_signal_fall_with_the_fourth_power_of_their_distance() -> None:
    """Those of straight lines fall with the second power."""
    errors = [float(np.max(np.abs(resampled(sampled(step), GRID) - hand(GRID)))) for step in (0.4, 0.2, 0.1)]
    orders = -np.diff(np.log2(errors))
    assert np.all((orders > 3.5) & (orders < 4.6)), orders


@pytest.mark.parametrize("offset_s", [0.0, 0.07, 0.13])
def test_a_coarse_smooth_command_is_not_late(offset_s: float) -> None:
    """What a lag makes of it is what it makes of the command itself, within a tenth of what straight lines are off."""
    stamps = offset_s + np.arange(-1.0, 22.0, 0.4)
    coarse = signal(stamps, hand(stamps), "rad")
    off = np.abs(resampled(coarse, GRID) - hand(GRID))
    lines = np.abs(np.interp(GRID, stamps, hand(stamps)) - hand(GRID))
    assert np.mean(off) < 0.1 * np.mean(lines)


@pytest.mark.parametrize(
    "source",
    [
        pytest.param(sampled(0.1, noise=0.1), id="noise"),
        pytest.param(signal(sampled(0.1).time_s, np.sign(hand(sampled(0.1).time_s)), "1"), id="steps"),
        pytest.param(
            signal(sampled(0.1).time_s, np.repeat(hand(sampled(0.1).time_s)[::5], 5)[:201], "1"),
            id="repeated",
        ),
        pytest.param(signal(np.arange(0.0, 20.0, 0.1), np.full(200, 3.0), "1"), id="constant"),
        pytest.param(signal(np.array([0.0, 20.0]), np.array([1.0, 2.0]), "1"), id="two samples"),
    ],
)
def test_what_a_curve_does_not_predict_goes_straight(source: Signal) -> None:
    assert not is_smooth(source)
    assert np.array_equal(resampled(source, GRID), np.interp(GRID, source.time_s, source.value))


def test_an_outlier_does_not_ring() -> None:
    """A reading that is far off stays the only one: a spline through it would be off for some samples to either side."""
    good = sampled(0.1)
    value = good.value.copy()
    value[100] += 5.0
    found = resampled(signal(good.time_s, value, "rad"), GRID)
    beside = np.abs(GRID - good.time_s[100]) > 0.1
    assert np.max(np.abs(found - hand(GRID))[beside]) < 0.02


def test_no_curve_goes_through_a_gap() -> None:
    whole = sampled(0.1)
    there = (whole.time_s < 8.0) | (whole.time_s > 11.0)
    known_s, known = whole.time_s[there], whole.value[there]
    found = resampled(signal(known_s, known, "rad"), GRID)
    gap = (GRID > 8.0) & (GRID < 11.0)
    assert np.allclose(found[gap], np.interp(GRID, known_s, known)[gap])
    outside = (GRID < 7.85) | (GRID > 11.1)
    assert np.max(np.abs(found - hand(GRID))[outside]) < 1e-3


def test_beyond_its_ends_a_signal_is_constant() -> None:
    source = sampled(0.1)
    wider = np.linspace(-3.0, 25.0, 281)
    found = course(source)(wider)
    assert np.all(found[wider < 0.0] == source.value[0])
    assert np.all(found[wider > 20.01] == source.value[-1])
