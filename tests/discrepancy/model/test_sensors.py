"""Faults of sensors, and stamps of held values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.model.sensors import delayed, lagged, sensor_effects, through_sensors
from discrepancy.signals.recording import changes_only


@given(st.floats(0.02, 1.0), st.floats(0.1, 3.0))
def test_a_lag_follows_a_ramp_by_its_time_constant(time_constant: float, slope: float) -> None:
    t = np.arange(0.0, 12.0, 0.01)
    late = lagged(slope * t, time_constant, 0.01)
    assert late[-1] == pytest.approx(slope * (t[-1] - time_constant), abs=slope * 2e-3)


def test_a_lag_rounds_a_step_and_a_delay_shifts_it() -> None:
    t = np.arange(0.0, 2.0, 0.01)
    step = (t >= 1.0).astype(float)
    assert lagged(step, 0.2, 0.01)[t.searchsorted(1.2)] == pytest.approx(1.0 - np.exp(-1.0), abs=0.02)
    assert delayed(step, 0.2, t)[t.searchsorted(1.15)] == 0.0
    assert delayed(step, 0.2, t)[t.searchsorted(1.25)] == 1.0


def test_every_sensor_effect_is_nothing_at_its_baseline() -> None:
    t = np.arange(0.0, 1.0, 0.01)
    effects = sensor_effects("y", "m", bias=0.1)
    off = {p.name: p.value for e in effects for p in e.parameters}
    np.testing.assert_array_equal(through_sensors({"y": np.sin(t)}, off, t, 0.01, 0.0, {})["y"], np.sin(t))


def test_a_hold_is_a_mean_delay_of_half_its_length() -> None:
    """A ramp sampled every 0.1 s and held: at the stamps kept, the reading is 0.05 s old on average."""
    t = np.arange(0.0, 10.0, 0.01)
    held = np.floor(t / 0.1 + 1e-9) * 0.1
    kept = changes_only(t, held, "m")
    assert np.mean(kept.time_s - kept.value) == pytest.approx(0.05, abs=0.006)
    assert kept.time_s.size == 99


@given(st.floats(1e-3, 100.0), st.floats(1e-6, 1e6))
def test_every_trial_step_of_a_sensor_effect_is_within_its_bounds(delay_s: float, bias: float) -> None:
    for p in (p for e in sensor_effects("y", "m", bias=bias, delay_s=delay_s) for p in e.parameters):
        assert all(p.lower <= value <= p.upper for value in p.trial_values), p.name
