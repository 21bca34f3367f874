"""Faults of the sensors, sampled through a bank of otherwise ideal sensors."""

import math

import numpy as np
import pytest

from plant.effects import find_effect
from plant.effects.faults import GROUPS
from plant.unit.sensor_parameters import ChannelParameters, SensorParameters
from plant.unit.sensors import Health, SensorBank, faulty
from plant.unit.signals import CHANNELS, INDEX

STEP = 0.01
PRESSURES = ("lift_pressure", "tilt_pressure", "steering_pressure_left", "steering_pressure_right")


def bank(name=None, given=None, **values):
    parameters = SensorParameters() if given is None else given
    chosen = () if name is None else (find_effect(name).of(**values),)
    return SensorBank(faulty(parameters, chosen), step=STEP, generator=np.random.default_rng(1))


def read(sensors, rows):
    return np.array([sensors.sample(row).values for row in rows])


def still(**values):
    row = np.zeros(len(CHANNELS))
    for name, value in values.items():
        row[INDEX[name]] = value
    return row


def shift(name, truth, **values):
    return bank(name, **values).sample(truth).values - bank().sample(truth).values


@pytest.mark.parametrize(
    ("name", "values", "channels"),
    [
        ("gyro_bias", {"yaw_deg_s": 0.4}, {"yaw_rate": math.radians(0.4)}),
        ("gyro_bias", {"roll_deg_s": -1.0, "yaw_deg_s": 0.0}, {"roll_rate": math.radians(-1.0)}),
        (
            "accelerometer_bias",
            {"x_m_s2": 0.15, "z_m_s2": -0.1},
            {"specific_force_x": 0.15, "specific_force_z": -0.1},
        ),
        ("articulation_offset", {"offset_deg": 0.5}, {"articulation_angle": math.radians(0.5)}),
        ("pressure_error", {"offset_kPa": 200.0}, dict.fromkeys(PRESSURES, 2e5)),
    ],
)
def test_an_offset_is_the_same_at_rest_and_in_motion(name, values, channels):
    expected = still(**channels)
    for truth in (still(), np.linspace(-1.0, 1.0, len(CHANNELS))):
        np.testing.assert_allclose(shift(name, truth, **values), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "channel", "factor"),
    [
        ("wheel_speed_scale", "wheel_speed_front_left", 1.02),
        ("torque_scale", "wheel_torque_rear_right", 1.05),
    ],
)
def test_a_scale_is_in_proportion(name, channel, factor):
    for value in (0.0, 3.0, -20.0):
        reading = bank(name).sample(still(**{channel: value})).value(channel)
        assert reading == pytest.approx(factor * value, rel=1e-12)


@pytest.mark.parametrize(
    ("angles", "leaks"),
    [
        ({"roll_deg": 1.0}, {"specific_force_y": 9.81 * math.sin(math.radians(1.0))}),
        ({"roll_deg": 0.0, "pitch_deg": 1.0}, {"specific_force_x": -9.81 * math.sin(math.radians(1.0))}),
    ],
)
def test_misalignment_lets_gravity_leak_into_the_level_axes(angles, leaks):
    level = still(specific_force_z=9.81, yaw_rate=0.5)
    seen = bank("imu_misalignment", **angles).sample(level)
    for name, value in leaks.items():
        assert seen.value(name) == pytest.approx(value, rel=1e-6)
    gravity = [seen.value(f"specific_force_{axis}") for axis in "xyz"]
    rates = [seen.value(f"{axis}_rate") for axis in ("roll", "pitch", "yaw")]
    assert np.linalg.norm(gravity) == pytest.approx(9.81, rel=1e-12)
    assert np.linalg.norm(rates) == pytest.approx(0.5, rel=1e-12)
    assert rates[2] < 0.5


def ramp(count=200):
    return np.outer(np.arange(count), np.ones(len(CHANNELS)))


@pytest.mark.parametrize("group", list(GROUPS))
@pytest.mark.parametrize(("name", "field"), [("sensor_delay", "delay"), ("sensor_lag", "lag")])
def test_a_ramp_comes_late_by_the_time_given_and_only_in_its_group(name, field, group):
    others = {f"{other}_ms": 0.0 for other in GROUPS if other != group}
    late = ramp() - read(bank(name, **others, **{f"{group}_ms": 40.0}), ramp())
    for channel, index in INDEX.items():
        expected = 4.0 if channel in GROUPS[group] else 0.0  # samples
        assert late[-1, index] == pytest.approx(expected, abs=0.6 if field == "lag" else 1e-9), channel


def test_a_lag_rounds_a_step_and_a_delay_does_not():
    rows = np.vstack((np.zeros((5, len(CHANNELS))), np.ones((60, len(CHANNELS)))))
    at = INDEX["yaw_rate"]
    delayed = read(bank("sensor_delay", inertial_ms=40.0), rows)[:, at]
    lagged = read(bank("sensor_lag", inertial_ms=40.0), rows)[:, at]
    assert set(delayed) == {0.0, 1.0}
    assert np.argmax(delayed) == 9
    assert np.count_nonzero((lagged > 0.01) & (lagged < 0.99)) > 10


def test_a_clock_offset_makes_every_channel_late_by_the_same():
    late = ramp() - read(bank("clock_offset", late_ms=60.0), ramp())
    np.testing.assert_allclose(late[-1], 6.0, atol=1e-9)


def test_dropped_samples_repeat_the_last_and_say_so():
    sensors = bank("sensor_dropout", inertial_percent=20.0)
    at, rows = INDEX["yaw_rate"], ramp(4000)
    previous, missing = None, 0
    for row in rows:
        seen = sensors.sample(row)
        if previous is not None and seen.values[at] == previous:
            missing += 1
            assert seen.health[at] == Health.ERROR
        previous = seen.values[at]
    assert missing == pytest.approx(800, abs=4 * math.sqrt(4000 * 0.2 * 0.8))


def test_coarser_steps():
    given = SensorParameters({"yaw_rate": ChannelParameters(resolution=0.01)})
    sensors = bank("coarse_resolution", given=given, factor=5.0)
    values = {
        round(sensors.sample(still(yaw_rate=x)).value("yaw_rate"), 9) for x in np.linspace(0.0, 1.0, 301)
    }
    assert values == {round(0.05 * k, 9) for k in range(21)}
