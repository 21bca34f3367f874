"""Each parameter of a sensor fault changes its own channels by its own amount."""

import math

import numpy as np
import pytest

from plant.effects.faults import GROUPS
from plant.unit.sensors import Health
from plant.unit.signals import CHANNELS, INDEX
from tests.plant.effects.test_faults import PRESSURES, bank, ramp, shift, still

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


@pytest.mark.parametrize("value", [0.7, -0.4])
@pytest.mark.parametrize(
    ("name", "parameter", "channel", "si"),
    [("gyro_bias", f"{axis}_deg_s", f"{axis}_rate", math.pi / 180) for axis in ("roll", "pitch", "yaw")]
    + [("accelerometer_bias", f"{axis}_m_s2", f"specific_force_{axis}", 1.0) for axis in "xyz"],
)
def test_a_bias_is_that_of_its_axis(name, parameter, channel, si, value):
    others = {"gyro_bias": {"yaw_deg_s": 0.0}, "accelerometer_bias": {"x_m_s2": 0.0}}[name]
    seen = shift(name, still(), **(others | {parameter: value}))
    np.testing.assert_allclose(seen, still(**{channel: si * value}), atol=1e-12)


@pytest.mark.parametrize("percent", [4.0, -7.0])
@pytest.mark.parametrize(
    ("name", "parameter", "others", "channels"),
    [
        (
            f"{name}_scale",
            f"{axle}_percent",
            {f"{other}_percent": 0.0},
            [f"{name}_{wheel}" for wheel in WHEELS if wheel.startswith(axle)],
        )
        for name in ("wheel_speed", "wheel_torque")
        for axle, other in (("front", "rear"), ("rear", "front"))
    ]
    + [
        (
            "articulation_offset",
            "scale_percent",
            {"offset_deg": 0.0},
            ["articulation_angle", "articulation_rate"],
        ),
        ("pressure_error", "scale_percent", {"offset_kPa": 0.0}, PRESSURES),
    ],
)
def test_a_scale_is_in_proportion_and_in_its_channels_only(name, parameter, others, channels, percent):
    fault = name.replace("wheel_torque", "torque")
    truth = np.linspace(-3.0, 5.0, len(CHANNELS))
    expected = still(**{channel: percent / 100.0 * truth[INDEX[channel]] for channel in channels})
    np.testing.assert_allclose(shift(fault, truth, **others, **{parameter: percent}), expected, atol=1e-12)


@pytest.mark.parametrize("degrees", [5.0, -12.0])
def test_a_sensor_turned_to_the_left_reads_what_is_ahead_on_its_right(degrees):
    angle = math.radians(degrees)
    seen = bank("imu_misalignment", roll_deg=0.0, yaw_deg=degrees).sample(
        still(specific_force_x=2.0, yaw_rate=0.5)
    )
    assert seen.value("specific_force_x") == pytest.approx(2.0 * math.cos(angle))
    assert seen.value("specific_force_y") == pytest.approx(-2.0 * math.sin(angle))
    assert seen.value("yaw_rate") == pytest.approx(0.5)


@pytest.mark.parametrize("group", list(GROUPS))
def test_the_given_share_of_a_groups_samples_is_lost(group):
    """Of n samples the share p is lost within four standard deviations of the binomial."""
    others = {f"{other}_percent": 0.0 for other in GROUPS if other != group}
    sensors, n, p = bank("sensor_dropout", **others, **{f"{group}_percent": 30.0}), 3000, 0.3
    lost = np.zeros(len(CHANNELS))
    for row in ramp(n):
        lost += np.asarray(sensors.sample(row).health) == Health.ERROR
    for channel, index in INDEX.items():
        if channel in GROUPS[group]:
            assert lost[index] == pytest.approx(n * p, abs=4 * math.sqrt(n * p * (1 - p))), channel
        else:
            assert lost[index] == 0, channel
