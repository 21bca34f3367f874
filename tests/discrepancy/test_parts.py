"""Units, sensors, projection and location by themselves."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.fit import WindowStates
from discrepancy.functions import play
from discrepancy.locate import densest
from discrepancy.model import Parameter
from discrepancy.models import car
from discrepancy.noise import _autoregression, settled
from discrepancy.plausible import implausible
from discrepancy.problem import Problem
from discrepancy.recording import changes_only
from discrepancy.screen import Columns, collinearity, penalty, score
from discrepancy.sensors import delayed, lagged, sensor_effects, through_sensors
from discrepancy.units import confusions, parse_scaled, parse_unit
from discrepancy.windows import Block
from tests.discrepancy.toys import record, tank


@pytest.mark.parametrize(
    ("text", "same"), [("N", "kg.m/s^2"), ("N.m", "J"), ("Pa", "N/m^2"), ("m/s²", "m/s^2"), ("rad/s", "1/s")]
)
def test_units_that_are_the_same_quantity(text: str, same: str) -> None:
    assert parse_unit(text).same_quantity(parse_unit(same))


def test_a_force_per_speed_squared_is_mass_per_length() -> None:
    assert str(parse_unit("N") / parse_unit("m/s") ** 2) == "kg/m"


def test_an_unknown_unit_is_named() -> None:
    with pytest.raises(ValueError, match="furlong"):
        parse_unit("furlong/s")


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


def test_projection_leaves_nothing_of_the_initial_states() -> None:
    rng = np.random.default_rng(0)
    window = np.repeat([0, 1, 2], 40)
    local, rows = rng.normal(size=(120, 2)), np.ones(120, bool)
    states = WindowStates(local, window, rows)
    left = states.off(rng.normal(size=120))
    for w in range(3):
        assert np.abs(local[window == w].T @ left[window == w]).max() < 1e-9
    change = states.solve(local @ np.array([1.5, -0.5]), 3, window)
    np.testing.assert_allclose(change, [[1.5, -0.5]] * 3, atol=1e-9)


def test_channels_too_many_to_be_coupled_keep_their_own_memory() -> None:
    """Thirty oscillations of their own in 300 rows: a coupled order would take 900 numbers, and leave them as they are."""
    n, c, rng = 300, 30, np.random.default_rng(3)
    rows = rng.standard_normal((n, c))
    own = 2.0 * 0.9 * np.cos(np.linspace(0.3, 2.5, c))
    for k in range(2, n):
        rows[k] += own * rows[k - 1] - 0.81 * rows[k - 2]
    block = Block(0, 0, tuple(f"y{i}" for i in range(c)), 0.04 * np.arange(n), 0)
    whitener = _autoregression([block], rows.ravel(), 1.0, np.zeros(c))
    white = whitener.apply(rows[:, :, None])[:, :, 0]
    correlation = np.sum(white[1:] * white[:-1], axis=0) / np.sum(white**2, axis=0)
    assert np.sqrt(np.mean(correlation**2)) < 2.0 / np.sqrt(n)
    assert white.var() == pytest.approx(1.0, rel=0.1)


def test_an_integrating_autoregression_is_made_to_forget() -> None:
    past = settled(np.array([[[1.0]]]), run=100)
    assert past[0, 0, 0] == pytest.approx(0.96)
    assert settled(np.array([[[0.5]]]), run=100)[0, 0, 0] == 0.5


def test_play_forgets_small_movements_and_follows_large_ones() -> None:
    x = np.array([0.0, 0.2, -0.2, 2.0, 1.8, -2.0])
    np.testing.assert_allclose(play(x, 0.5), [0.0, 0.0, 0.0, 1.5, 1.5, -1.5])


def test_the_densest_stretch_is_found() -> None:
    assert densest(np.array([-1.0, 2.0, 3.0, -1.0, 2.0, -5.0])) == (1, 5)


def test_more_candidates_need_more_evidence() -> None:
    assert penalty(1, 40, 0.02) > penalty(1, 4, 0.02) > penalty(1, 4, 0.1)
    assert penalty(3, 10, 0.02) > penalty(1, 10, 0.02)


def test_collinearity_does_not_depend_on_scale_and_vanishes_at_right_angles() -> None:
    a, b = np.array([[1.0], [0.0], [0.0]]), np.array([[0.0], [2.0], [0.0]])
    assert collinearity(a, 7.0 * a) == pytest.approx(1.0)
    assert collinearity(a, b) == pytest.approx(0.0)


def test_a_parameter_outside_its_bounds_is_refused() -> None:
    with pytest.raises(ValueError, match=r"outside \[0"):
        Parameter(name="cd", unit="1", value=-1.0, lower=0.0, upper=2.0)


@pytest.mark.parametrize(
    ("text", "si", "factor"),
    [
        ("km/h", "m/s", 1.0 / 3.6),
        ("deg/s", "rad/s", np.pi / 180.0),
        ("°", "rad", np.pi / 180.0),
        ("kN", "N", 1e3),
        ("kNm", "N.m", 1e3),
        ("bar", "Pa", 1e5),
        ("rpm", "rad/s", 2.0 * np.pi / 60.0),
        ("mm/s²", "m/s^2", 1e-3),
        ("1/min", "1/s", 1.0 / 60.0),
        ("%", "1", 0.01),
        ("", "1", 1.0),
        ("g", "m/s^2", 9.80665),
    ],
)
def test_headings_are_converted_to_si(text: str, si: str, factor: float) -> None:
    scaled = parse_scaled(text)
    assert scaled.unit.same_quantity(parse_unit(si))
    assert scaled.factor == pytest.approx(factor, rel=1e-12)


def test_confusions_are_factors_between_units_of_the_same_quantity_both_ways() -> None:
    speeds = confusions("m/s")
    assert speeds["km/h under a heading of m/s"] == pytest.approx(3.6)
    assert speeds["m/s under a heading of km/h"] == pytest.approx(1.0 / 3.6)
    assert not any("deg" in text for text in speeds)


def test_the_nearest_probe_is_the_one_that_leaves_least_whatever_the_slope_at_another() -> None:
    """Nearly no change points the right way and goes no way; a finite one goes most of it."""
    effect = sensor_effects("y", "1", bias=1.0, kinds=("delay",))[0]
    residual, raw = (
        np.array([1.0, 1.0, 0.0]),
        (np.array([[0.02], [0.02], [0.0]]), np.array([[1.0], [1.0], [1.0]])),
    )
    columns = Columns(effect, raw, (np.array([0.001]), np.array([0.05])))
    seen = [(X, float(np.sum(X**2))) for X in raw]
    found = score(columns, seen, residual, 10.0, np.arange(3))
    assert (found.probe, found.nearest) == (0, 1)


def test_an_effect_of_which_one_combination_is_hidden_could_not_be_judged() -> None:
    """Front and rear show by their difference only: both alike would go unnoticed, so 'ruled out' would be wrong."""
    ends = tuple(Parameter(name=f"pressure.{end}", unit="bar", typical=0.4) for end in ("front", "rear"))
    effect = replace(sensor_effects("y", "1", bias=1.0, kinds=("bias",))[0], parameters=ends)
    one, other = np.random.default_rng(1).normal(size=(2, 4000))
    change = np.array([0.4, 0.4])
    for raw, visible in (
        (np.stack([one, other], axis=1), True),
        (np.stack([one, 1e-3 * other - one], axis=1), False),
    ):
        found = score(
            Columns(effect, (raw,), (change,)),
            [(raw, float(np.sum(raw**2)))],
            0.0 * one,
            20.0,
            np.arange(4000) % 5,
        )
        assert (found.power > 0.99) == visible
        assert found.power > 0.0


def test_a_vanishing_relaxation_length_changes_nothing_and_a_long_one_is_a_lag_of_length_over_speed() -> None:
    time_s = 0.01 * np.arange(2000)
    yaw_rate, speed = np.sin(3.0 * time_s), np.full(time_s.size, 1.3)
    np.testing.assert_allclose(car._relaxed(yaw_rate, speed, 1e-6, 0.01), yaw_rate, atol=1e-5)
    relaxed = car._relaxed(yaw_rate, speed, 0.13, 0.01)
    np.testing.assert_allclose(relaxed, lagged(yaw_rate, 0.1, 0.01), atol=1e-3)


def test_a_zero_point_that_is_off_is_no_other_clock() -> None:
    """The level is known at the start, so nothing takes the offset away before prediction and reading are compared."""
    model = tank("level bias")
    area, level = model.nuisances
    known = replace(model, nuisances=(area, replace(level, scope="all", guess=None, value=0.5)))
    for seed in range(1, 7):
        assert implausible(Problem(known, [record(seed, bias=-3.0)])) == []
    late = record(2)
    level_late = replace(late.signals["level"], time_s=late.signals["level"].time_s + 9.0)
    shifted = replace(late, signals={**late.signals, "level": level_late})
    (told,) = implausible(Problem(known, [shifted]))
    assert "another clock" in told.text
