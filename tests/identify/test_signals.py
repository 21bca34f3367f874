"""Filters and the Kalman smoother: known answers, delays as stated, noise found by likelihood."""

import numpy as np
import pytest

from identify.signals.filters import (
    averaged,
    causal_low_pass,
    differentiated,
    filled,
    long_gaps,
    low_pass,
    low_pass_delay,
    spikes,
    unwrapped,
)
from identify.signals.kalman import motion
from identify.signals.rejection import Rejection


def test_central_differences_are_exact_for_a_parabola_inside():
    t = np.arange(0.0, 1.0, 0.01)
    assert differentiated(t**2, 0.01)[1:-1] == pytest.approx(2.0 * t[1:-1])


def test_offline_filter_does_not_delay_and_removes_15_hz():
    t = np.arange(0.0, 20.0, 0.002)
    slow = np.sin(2.0 * np.pi * 0.3 * t)
    got = low_pass(slow + 0.5 * np.sin(2.0 * np.pi * 15.0 * t), 500.0)
    assert np.max(np.abs(got - slow)[500:-500]) < 1e-3


def test_causal_filter_delays_by_what_it_states():
    t = np.arange(0.0, 10.0, 0.002)
    ramp, delay = causal_low_pass(t, 500.0)
    assert delay == pytest.approx(0.183, abs=5e-4)  # 9th order, 5 Hz: the figure of the audit of the thesis
    assert (t - ramp)[-1] == pytest.approx(delay, abs=1e-3)
    assert low_pass_delay(10.0) == pytest.approx(delay / 2.0)


def test_encoder_wrap_leaves_a_straight_line():
    turn = np.arange(0.0, 40.0, 0.05)
    assert unwrapped((turn + np.pi) % (2.0 * np.pi) - np.pi) == pytest.approx(turn)


def test_spikes_are_found_and_a_smooth_signal_has_none():
    random = np.random.default_rng(0)
    x = np.sin(np.arange(2000) / 200.0) + 0.01 * random.standard_normal(2000)
    assert not spikes(x).any()
    x[[100, 700]] += 1.0
    assert np.flatnonzero(spikes(x)).tolist() == [100, 700]


def test_gaps_are_bridged_and_long_ones_named():
    kept = np.ones(100, bool)
    kept[10:14] = kept[50:80] = False
    assert filled(np.where(kept, np.arange(100.0), np.nan), kept)[11:13] == pytest.approx(
        [11.0, 12.0], abs=0.6
    )
    assert np.flatnonzero(long_gaps(kept, 10)).tolist() == list(range(50, 80))
    with pytest.raises(ValueError, match="only 1 of 100"):
        filled(np.zeros(100), np.arange(100) == 3)


def test_averages_skip_what_is_rejected():
    value, count = averaged(np.array([1.0, 3.0, 5.0, 99.0]), np.array([True, True, True, False]), 2)
    assert value.tolist() == [2.0, 5.0]
    assert count.tolist() == [2.0, 1.0]


def test_each_rejected_sample_has_one_reason():
    r = Rejection(10)
    r.reject(np.arange(10) < 4, "early")
    r.reject(np.arange(10) < 6, "slow")
    assert r.counts == {"early": 4, "slow": 2}
    assert np.count_nonzero(r.kept) == 4


def simulated(q, r, n=4000, dt=0.005, seed=1):
    random = np.random.default_rng(seed)
    velocity = np.cumsum(np.sqrt(q * dt) * random.standard_normal(n))
    position = np.cumsum(velocity) * dt
    return np.arange(n) * dt, position + r * random.standard_normal(n), velocity


@pytest.mark.parametrize(("q", "r"), [(0.1, 1e-3), (5.0, 3e-3)])
def test_likelihood_finds_both_noises(q, r):
    t, z, _ = simulated(q, r)
    found = motion(t, z)
    assert found.reading_sd == pytest.approx(r, rel=0.1)
    assert np.log10(found.acceleration_density / q) == pytest.approx(0.0, abs=0.25)


def test_velocity_errs_as_its_standard_deviation_says():
    t, z, velocity = simulated(0.5, 2e-3)
    found = motion(t, z)
    assert np.std((found.velocity - velocity) / found.velocity_sd) == pytest.approx(1.0, abs=0.15)


def test_smoother_bridges_missing_readings_and_rejects_jumps():
    t, z, velocity = simulated(0.1, 1e-3)
    z[1000:1040] = np.nan
    z[2000] += 1.0
    found = motion(t, z)
    assert found.rejected[2000]
    assert np.count_nonzero(found.rejected) <= 2
    assert abs(found.velocity[1020] - velocity[1020]) < 4.0 * found.velocity_sd[1020]


def test_a_filter_that_lost_its_track_finds_back():
    t = np.arange(0.0, 10.0, 0.005)
    z = 2.0 * t + 1.5 * np.maximum(t - 5.0, 0.0) + 5e-4 * np.random.default_rng(3).standard_normal(t.size)
    found = motion(t, z, noise=(1e-6, 5e-4))  # by these noises the speed cannot change as it does
    assert found.velocity[-1] == pytest.approx(3.5, rel=0.02)


def test_stamps_that_do_not_ascend_are_refused():
    with pytest.raises(ValueError, match="ascend"):
        motion(np.array([0.0, 1.0, 1.0, 2.0, 3.0]), np.zeros(5))
