"""Laws of the sensor model: each term alone, exactly where it is exact, statistically where it is random."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from configuration import CheckedTable, ConfigurationError
from plant.unit.sensor_parameters import ChannelParameters, SensorParameters, read_sensors
from plant.unit.sensors import Health, SensorBank
from plant.unit.signals import CHANNELS, FAMILIES, INDEX

STEP = 0.01
COUNT = len(CHANNELS)
CHANNEL = "yaw_rate"
COLUMN = INDEX[CHANNEL]


def bank(seed: int = 1, **parameters: float) -> SensorBank:
    """A bank whose yaw rate sensor has these parameters; all others are ideal."""
    sensors = SensorParameters({CHANNEL: ChannelParameters(**parameters)})
    return SensorBank(sensors, step=STEP, generator=np.random.default_rng(seed))


def respond(sensors: SensorBank, inputs: np.ndarray) -> np.ndarray:
    """Readings of the yaw rate sensor for a series of inputs; every other channel gets the same input."""
    return np.array([sensors.sample(np.full(COUNT, value)).values[COLUMN] for value in inputs])


values = st.floats(-1e6, 1e6, allow_nan=False)


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.lists(values, min_size=COUNT, max_size=COUNT), min_size=1, max_size=5))
def test_ideal_sensors_return_their_input_bit_for_bit(rows):
    sensors = SensorBank(SensorParameters(), step=STEP, generator=np.random.default_rng(0))
    for row in rows:
        readings = sensors.sample(row)
        assert readings.values.tolist() == row
        assert not readings.health.any()


def test_noise_has_the_stated_mean_and_variance():
    """n = 20 000: mean within 5 sigma/sqrt(n); variance within 5 sqrt(2/n), relative."""
    n, sigma = 20_000, 0.3
    readings = respond(bank(noise=sigma), np.full(n, 2.0))
    assert readings.mean() == pytest.approx(2.0, abs=5 * sigma / math.sqrt(n))
    assert readings.var() == pytest.approx(sigma**2, rel=5 * math.sqrt(2 / n))


def test_noise_is_white():
    """Correlation of neighbours within 5/sqrt(n) of zero."""
    n = 20_000
    noise = respond(bank(noise=1.0), np.zeros(n))
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 5 / math.sqrt(n)


def test_noise_of_one_channel_does_not_depend_on_the_parameters_of_another():
    other = SensorParameters(
        {
            CHANNEL: ChannelParameters(noise=1.0),
            "roll_rate": ChannelParameters(noise=2.0, delay=0.05, dropout=0.5),
        }
    )
    with_other = respond(SensorBank(other, step=STEP, generator=np.random.default_rng(1)), np.zeros(50))
    np.testing.assert_array_equal(with_other, respond(bank(noise=1.0), np.zeros(50)))


def test_equal_seeds_give_equal_bits_and_others_do_not():
    inputs = np.linspace(-1, 1, 100)
    first, second, third = (
        respond(bank(seed, noise=0.1, dropout=0.2, lag=0.02), inputs) for seed in (7, 7, 8)
    )
    np.testing.assert_array_equal(first, second)
    assert (first != third).any()


@pytest.mark.parametrize("steps", [0, 1, 2, 3, 7, 40])
def test_a_delay_of_whole_steps_is_exact(steps):
    inputs = np.random.default_rng(3).normal(size=100)
    readings = respond(bank(delay=steps * STEP), inputs)
    np.testing.assert_array_equal(readings[steps:], inputs[: len(inputs) - steps])
    np.testing.assert_array_equal(readings[:steps], inputs[0])  # settled at the first input


@given(st.floats(0, 0.2))
def test_a_ramp_is_delayed_by_any_delay_exactly(delay):
    """Linear interpolation has no error on a straight line, once the buffer has filled."""
    time = np.arange(60) * STEP
    readings = respond(bank(delay=delay), 5.0 * time)
    filled = time > delay + STEP
    np.testing.assert_allclose(readings[filled], 5.0 * (time - delay)[filled], atol=1e-9)


@pytest.mark.parametrize("lag", [0.002, 0.01, 0.05, 0.5])
def test_the_step_response_of_a_lag_is_the_exponential(lag):
    inputs = np.concatenate([[0.0], np.ones(200)])
    time = np.arange(201) * STEP
    np.testing.assert_allclose(
        respond(bank(lag=lag), inputs), 1 - np.exp(-time / lag), rtol=1e-12, atol=1e-15
    )


@given(st.floats(-1e3, 1e3), st.sampled_from([0.002, 0.25, 3.0]))
def test_quantisation_is_off_by_half_a_step_at_most(value, resolution):
    reading = respond(bank(resolution=resolution), np.array([value]))[0]
    assert abs(reading - value) <= resolution / 2 * (1 + 1e-9)
    assert reading / resolution == pytest.approx(round(reading / resolution), abs=1e-6)


@given(st.floats(-10, 10), st.floats(-0.5, 0.5), st.floats(-5, 5))
def test_scale_and_bias_are_affine(value, scale_error, bias):
    reading = respond(bank(scale_error=scale_error, bias=bias), np.array([value]))[0]
    assert reading == pytest.approx(value + scale_error * value + bias, abs=1e-12)


def test_saturation_holds_the_range_and_says_degraded():
    sensors = bank(minimum=-1.0, maximum=2.0)
    health = {}
    for value in (-3.0, -1.0, 0.5, 2.0, 9.0):
        readings = sensors.sample(np.full(COUNT, value))
        assert readings.value(CHANNEL) == min(max(value, -1.0), 2.0)
        health[value] = Health(int(readings.health[COLUMN]))
    assert health == {
        -3.0: Health.DEGRADED, -1.0: Health.OK, 0.5: Health.OK, 2.0: Health.OK, 9.0: Health.DEGRADED,
    }  # fmt: skip


def test_a_dropped_sample_repeats_the_last_and_says_error():
    n, share = 20_000, 0.3
    sensors = bank(dropout=share)
    last, dropped = 0.0, 0
    for k in range(n):
        readings = sensors.sample(np.full(COUNT, float(k)))
        missing = readings.health[COLUMN] == Health.ERROR
        assert readings.value(CHANNEL) == (last if missing else k)
        last, dropped = readings.value(CHANNEL), dropped + int(missing)
    assert dropped / n == pytest.approx(share, abs=5 * math.sqrt(share * (1 - share) / n))


def table(**sections: dict) -> CheckedTable:
    return CheckedTable(sections, file="case.toml", section="sensors")


def test_units_of_the_file_become_si():
    sensors = read_sensors(
        table(
            yaw_rate={"bias_deg_s": 180.0, "lag_ms": 20.0, "scale_error_percent": 2.0},
            pressure={"noise_kpa": 25.0, "maximum_kpa": 40000.0, "delay_ms": 5},
        ),
        SensorParameters(),
    )
    assert sensors.of("yaw_rate").bias == pytest.approx(math.pi)
    assert sensors.of("yaw_rate").lag == pytest.approx(0.02)
    assert sensors.of("yaw_rate").scale_error == pytest.approx(0.02)
    for channel in ("lift_pressure", "tilt_pressure", "steering_pressure_left", "steering_pressure_right"):
        assert sensors.of(channel).noise == pytest.approx(25e3)
        assert sensors.of(channel).maximum == pytest.approx(40e6)
        assert sensors.of(channel).delay == pytest.approx(0.005)


def test_a_channel_has_the_last_word_over_its_family_whatever_the_order():
    entries = {"yaw_rate": {"noise_deg_s": 5.0}, "angular_rate": {"noise_deg_s": 1.0, "lag_ms": 8.0}}
    for names in (list(entries), list(reversed(entries))):
        sensors = read_sensors(table(**{name: entries[name] for name in names}), SensorParameters())
        assert sensors.of("yaw_rate").noise == pytest.approx(math.radians(5.0))
        assert sensors.of("roll_rate").noise == pytest.approx(math.radians(1.0))
        assert sensors.of("yaw_rate").lag == pytest.approx(0.008)


@pytest.mark.parametrize(
    ("sections", "words"),
    [
        ({"yaw_rat": {}}, ["case.toml", "sensors.yaw_rat", "yaw_rate"]),
        ({"yaw_rate": {"bias_deg": 1.0}}, ["sensors.yaw_rate.bias_deg ", "bias_deg_s"]),
        ({"pressure": {"noise_kpa": -1.0}}, ["sensors.pressure.noise_kpa", "-1.0 kPa", "0..inf kPa"]),
        ({"pressure": {"dropout_percent": 101}}, ["dropout_percent", "101 %", "0..100 %"]),
        ({"pressure": {"delay_ms": "5"}}, ["delay_ms", "'5'", "ms"]),
        (
            {"yaw_rate": {"minimum_deg_s": 3.0, "maximum_deg_s": 2.0}},
            ["minimum_deg_s", "3 deg/s", "below the maximum"],
        ),
    ],
)
def test_a_wrong_section_is_one_clear_error(sections, words):
    with pytest.raises(ConfigurationError) as error:
        read_sensors(table(**sections), SensorParameters())
    for word in words:
        assert word in str(error.value)


def test_every_channel_has_a_family():
    assert {channel.family for channel in CHANNELS.values()} == set(FAMILIES.values())


def test_sections_of_old_equipment_files_mean_the_same():
    """Before version 0.2 the accelerometers' channels and family were called acceleration."""
    old = {"acceleration": {"noise_m_s2": 0.1}, "acceleration_y": {"bias_m_s2": 0.2}}
    new = {"specific_force": {"noise_m_s2": 0.1}, "specific_force_y": {"bias_m_s2": 0.2}}
    read = [read_sensors(CheckedTable(text, file="a.toml"), SensorParameters()) for text in (old, new)]
    assert read[0] == read[1]
    assert read[0].of("specific_force_y").bias == 0.2
    assert read[0].of("specific_force_y").noise == 0.1


SLOPE = "pitch_angle"
PLACE = INDEX[SLOPE]


def slope_bank(**parameters: float) -> SensorBank:
    """A bank whose pitch sensor has these parameters; all others are ideal."""
    return SensorBank(
        SensorParameters({SLOPE: ChannelParameters(**parameters)}),
        step=STEP,
        generator=np.random.default_rng(1),
    )


def slopes(sensors: SensorBank, true: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """Readings of the pitch sensor for series of the true angle and of what its accelerometers take for it."""
    rows = []
    for angle, taken in zip(true, felt, strict=True):
        row = np.zeros(COUNT)
        row[PLACE] = angle
        rows.append(sensors.sample(row, np.array([taken, 0.0])).values[PLACE])
    return np.array(rows)


@settings(deadline=None)
@given(st.floats(0.0, 3.0), st.floats(-0.5, 0.5))
def test_a_levelled_sensor_that_feels_no_acceleration_reads_its_angle(levelling, angle):
    true = angle * np.sin(np.arange(200) * STEP)
    np.testing.assert_array_equal(slopes(slope_bank(levelling=levelling), true, true), true)


def test_a_lasting_acceleration_leans_the_sensor_with_its_time_constant():
    """Truth 0, felt a step: the response of a first-order low-pass, 1 - exp(-t/T)."""
    felt = np.concatenate([[0.0], np.full(400, 0.2)])
    read = slopes(slope_bank(levelling=0.8), np.zeros(401), felt)
    time = STEP * np.arange(401)
    np.testing.assert_allclose(read, 0.2 * (1.0 - np.exp(-time / 0.8)), atol=1e-12)


def test_a_change_of_slope_shows_at_once_through_the_gyro():
    """Both change together, as a slope does: nothing lags, however slow the accelerometers' correction."""
    true = np.concatenate([np.zeros(50), np.full(50, 0.1)])
    np.testing.assert_allclose(slopes(slope_bank(levelling=5.0), true, true), true, atol=1e-15)


def test_an_inclination_sensor_without_a_gyro_reads_what_it_feels():
    felt = np.sin(np.arange(100.0))
    np.testing.assert_allclose(
        slopes(slope_bank(levelling=0.0), np.zeros(100), felt), felt, rtol=0, atol=1e-15
    )


def test_a_sensor_that_does_not_level_itself_feels_no_acceleration():
    true, felt = np.linspace(0, 1, 30), np.ones(30)
    np.testing.assert_array_equal(slopes(slope_bank(), true, felt), true)


def test_levelling_is_for_inclination_sensors_only():
    table = CheckedTable({"slope_angle": {"levelling_s": 1.5}}, file="sensors.toml")
    assert read_sensors(table, SensorParameters()).of("roll_angle").levelling == 1.5
    with pytest.raises(ConfigurationError, match="levelling_s"):
        read_sensors(
            CheckedTable({"yaw_rate": {"levelling_s": 1.5}}, file="sensors.toml"), SensorParameters()
        )
