"""Faults of sensors, and stamps of held values."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.model.sensors import delayed, lagged, sensor_effects, shown, through_sensors
from discrepancy.signals.recording import changes_only, signal
from tests.discrepancy.toys import tank


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


def test_a_late_reading_within_a_recording_shows_what_was_before() -> None:
    t = 5.0 + 0.01 * np.arange(400)
    stamps = np.arange(0.0, 12.0, 0.05)
    value = 2.0 * stamps + 7.0  # with a bias
    value[85] += 5.0  # and a wrong reading
    readings = shown({"y": signal(stamps, value, "m")}, ("y", "z"))
    for late in ({"y.delay": 0.3}, {"y.lag": 0.1}, {"y.delay": 0.2, "y.lag": 0.05}, {"y.delay": -0.2}):
        seen = through_sensors({"y": 2.0 * t, "z": t}, late, t, 0.01, 0.0, {}, readings)["y"]
        # 1 % of what was before the time from which the lag starts is left
        np.testing.assert_allclose(seen, 2.0 * (t - sum(late.values())), atol=2e-3)
    constant = through_sensors({"y": 2.0 * t}, {"y.delay": 0.3}, t, 0.01, 0.0, {})["y"]
    assert np.all(constant[:30] == 10.0)


def test_a_drift_matters_by_what_it_adds_up_to_over_the_longest_recording() -> None:
    """Of a thermometer that is logged for a week, 0.3 K in a minute is no drift that anybody would ask about."""
    model = replace(tank(), effects=sensor_effects("level", "m", bias=0.3, kinds=("drift",)))
    for duration_s in (60.0, 6e5):
        (effect,) = model.in_recordings_of(duration_s).effects
        (drift,) = effect.parameters
        assert drift.typical * duration_s == pytest.approx(0.3)
        assert drift.upper * duration_s == pytest.approx(20 * 0.3)
    assert model.in_recordings_of(0.0) == model
