"""Inputs on the grid of a window."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.model.windows import cut, usable
from discrepancy.signals.recording import Recording, signal
from discrepancy.signals.resampling import resampled
from tests.discrepancy.toys import tank

GRID = 3.0 + 0.1 * np.arange(50)


def test_a_held_input_on_the_grid_is_taken_as_it_is() -> None:
    values = np.random.default_rng(0).normal(size=50)
    assert np.array_equal(resampled(signal(GRID, values, "N", held=True), GRID), values)


@given(st.floats(0.0, 1.0), st.integers(1, 30), st.integers(0, 2**32 - 1))
def test_a_held_input_keeps_its_impulse(offset: float, changes: int, seed: int) -> None:
    """Whenever a command comes, what it adds up to over the steps is what it was: it acts neither late nor early."""
    rng = np.random.default_rng(seed)
    stamps = np.concatenate([[GRID[0] - 0.2 * offset], np.sort(rng.uniform(GRID[0], GRID[-1], changes))])
    stamps = np.unique(stamps)
    values = rng.normal(size=stamps.size)
    fine = np.linspace(GRID[0], GRID[-1] + 0.1, 50_001)[:-1]
    truth = values[np.searchsorted(stamps, fine, side="right") - 1]
    found = resampled(signal(stamps, values, "N", held=True), GRID)
    # a value a thousandth of a step beside a grid point counts as on it
    np.testing.assert_allclose(found, truth.reshape(50, -1).mean(axis=1), atol=6e-3 * np.ptp(values) + 1e-9)


def test_before_its_first_stamp_a_held_input_has_its_first_value() -> None:
    late = signal(np.array([GRID[10] + 0.05, GRID[20]]), np.array([2.0, 5.0]), "N", held=True)
    found = resampled(late, GRID)
    assert np.all(found[:20] == 2.0)
    assert np.all(found[20:] == 5.0)


@pytest.mark.parametrize("late_s", [0.0, 0.03, 0.07])
def test_a_command_beside_the_grid_is_not_late(late_s: float) -> None:
    """A mass pushed by commands that come beside the grid is where it truly is at the grid's points."""
    stamps = GRID[0] - 0.1 + late_s + 0.1 * np.arange(52)
    values = np.random.default_rng(1).normal(size=52)
    force = resampled(signal(stamps, values, "N", held=True), GRID)
    fine = np.linspace(GRID[0], GRID[-1], 4901)
    exact = np.cumsum(values[np.searchsorted(stamps, fine + 1e-9, side="right") - 1])[99::100] * 1e-3
    np.testing.assert_allclose(np.cumsum(0.1 * force)[:-1], exact, atol=2e-3)


def starts_at(*inputs: tuple[Sequence[float], Sequence[float]], first_s: float = 0.0) -> float:
    """Where the grid begins in a recording with a wind that is there from first_s on; inputs: stamps and values of held ones."""
    names = ("inflow", "drain")[: len(inputs)]
    signals = {
        name: signal(np.array(stamps), np.array(values), "m/s", held=True)
        for name, (stamps, values) in zip(names, inputs, strict=True)
    }
    at = np.arange(first_s, 60.0, 0.1)
    signals |= {"wind": signal(at, np.sin(at), "m/s"), "level": signal(at, np.sin(at), "m")}
    model = replace(tank("leak"), inputs={**dict.fromkeys(names, "m/s"), "wind": "m/s"}, held=names)
    recording = Recording("r", signals)
    found = usable(model, recording, [])
    assert found is not None
    return next(iter(cut(model, recording, found[1]))).time_s[0]


EVERY_MINUTE = np.arange(0.0, 60.0, 3.0)
UP_AND_DOWN = (np.arange(20) % 3).astype(float)


def test_the_grid_falls_on_commands() -> None:
    """The wind is there from 0.03 s on; commands come at whole tenths, which are steps of the model."""
    assert starts_at((EVERY_MINUTE, UP_AND_DOWN), first_s=0.03) == pytest.approx(0.1)
    late = EVERY_MINUTE + 0.047
    assert starts_at((late, UP_AND_DOWN)) == pytest.approx(0.047)


def test_commands_without_a_common_phase_leave_the_grid_where_it_is() -> None:
    scattered = EVERY_MINUTE + np.random.default_rng(1).uniform(0.0, 0.1, 20)
    scattered[0] = 0.0
    assert starts_at((scattered, UP_AND_DOWN), first_s=0.03) == 0.03
    # of two inputs that disagree, neither is served
    assert starts_at((EVERY_MINUTE, UP_AND_DOWN), (EVERY_MINUTE + 0.05, UP_AND_DOWN), first_s=0.07) == 0.07
    assert starts_at((EVERY_MINUTE, np.zeros(20)), first_s=0.03) == 0.03


def test_commands_that_jitter_a_little_have_a_phase() -> None:
    scattered = EVERY_MINUTE + 0.05 + np.random.default_rng(1).normal(0.0, 0.002, 20)
    assert starts_at((scattered, UP_AND_DOWN)) % 0.1 == pytest.approx(0.05, abs=0.003)


@pytest.mark.parametrize(("every_s", "until_s"), [(3.0, 59.9), (0.1, 57.1)])
def test_a_command_is_known_for_as_long_as_it_has_stood_before(every_s: float, until_s: float) -> None:
    """Its last stamp is at 57 s, the level's at 59.9 s. A command that came every tenth of a second has ended there."""
    at, level = np.arange(0.0, 57.05, every_s), np.arange(0.0, 60.0, 0.1)
    signals = {
        "inflow": signal(at, np.sin(at), "m/s", held=True),
        "level": signal(level, np.cos(level), "m"),
    }
    found = usable(tank("leak"), Recording("r", signals), [])
    assert found is not None
    assert found[1] == pytest.approx((0.0, until_s))
