"""A small car: laws of its axles on a made drive, and public recordings on two floors."""

import numpy as np
import pytest
from scipy.signal import lfilter

from identify.car.fits import grip, sensor_delay, steering_lag
from identify.car.log import Car, CarLog, read_car
from identify.car.motion import body_motion
from identify.reading import BadRecording

CAR = Car()


@pytest.fixture(scope="module")
def made():
    """A bicycle whose front wheels roll without slip and whose rear axle is a known curve, steered in sines of growing size."""
    random = np.random.default_rng(1)
    step, t = 1e-3, np.arange(0.0, 60.0, 1e-3)
    command = np.clip((0.2 + 0.01 * t) * np.sin(1.1 * t), -1.0, 1.0)
    a = np.exp(-step / 0.09)
    lag = lfilter([1.0 - a], [1.0, -a], np.interp(t - 0.02, t, command))
    speed = 2.0
    rate = np.clip(speed * np.tan(0.4 * lag) / CAR.wheelbase, -2.5, 2.5)
    # the slip angle that the rear axle needs for its lateral force, by the curve turned round
    share = speed * rate / 9.81
    slip = np.tan(np.arcsin(np.clip(share / 0.7, -1.0, 1.0)) / 1.4) * 1.4 * 0.7 / 9.0
    yaw = np.cumsum(rate) * step
    course = yaw - slip  # of the rear axle
    x = np.cumsum(speed * np.cos(course)) * step + CAR.marker * np.cos(yaw)
    y = np.cumsum(speed * np.sin(course)) * step + CAR.marker * np.sin(yaw)
    rows = slice(None, None, 10)
    time = t[rows]
    held = np.floor(time / 0.1) * 0.1
    gyro = 1.03 * np.interp(held - 0.045, t, rate) + 0.01 * np.interp(
        held, time, random.standard_normal(time.size)
    )
    noise = 2e-4 * random.standard_normal((3, time.size))
    return CarLog(
        name="made", time=time, x=x[rows] + noise[0], y=y[rows] + noise[1], yaw=yaw[rows] + noise[2], steering=command[rows], gyro=gyro,
        encoder=np.full(time.size, speed),
    )  # fmt: skip


@pytest.fixture(scope="module")
def body(made):
    return body_motion(made, CAR)


def test_grip_of_the_rear_axle_is_that_of_the_curve(body):
    found = grip(body, "rear")
    assert found.values["stiffness"] == pytest.approx(9.0, rel=0.1)
    assert abs(found.values["grip"] - 0.7) < 3.0 * found.interval("grip").sd
    assert found.interval("grip").sd < 0.1


def test_gyro_delay_and_scale_are_those_of_the_sensor(made, body):
    found = sensor_delay(made, body, "gyro")
    assert found.values["delay"] == pytest.approx(0.045, abs=3e-3)
    assert found.values["scale"] == pytest.approx(1.03, abs=5e-3)


def test_a_car_that_stands_has_no_grip(made):
    still = body_motion(
        CarLog(
            **{
                **{f: getattr(made, f) for f in made.__dataclass_fields__},
                "x": made.x * 0.0,
                "y": made.y * 0.0,
            }
        ),
        CAR,
    )
    with pytest.raises(ValueError, match="hardly moves"):
        grip(still, "rear")


def test_a_recording_without_its_columns_is_refused(tmp_path):
    file = tmp_path / "drive.csv"
    file.write_text("vicon time,vicon x\n0,0\n1,1\n2,2\n")
    with pytest.raises(BadRecording, match="no column 'vicon y'"):
        read_car(file)


@pytest.mark.data
def test_tape_has_half_the_grip_of_rubber(recordings):
    found = [
        grip(body_motion(read_car(recordings / "dart_rc_car" / name), CAR), "front").interval("grip")
        for name in ("rubber_ramp_steer+0.25.csv.gz", "tape_circles_steer-0.3.csv.gz")
    ]
    assert found[0].lower > 1.5 * found[1].upper
    assert 0.35 < found[1].value / found[0].value < 0.65


@pytest.mark.data
@pytest.mark.parametrize("name", ["rubber_free_mid_100228", "tape_circles_steer-0.3"])
def test_gyro_is_as_late_as_its_description_says(recordings, name):
    log = read_car(recordings / "dart_rc_car" / f"{name}.csv.gz")
    found = sensor_delay(log, body_motion(log, CAR), "gyro")
    held = 0.05  # refreshed at 10 Hz
    assert 0.09 < found.values["delay"] + held < 0.10
    assert found.values["scale"] == pytest.approx(1.03, abs=0.01)


@pytest.mark.data
def test_steering_lags_as_its_description_says(recordings):
    log = read_car(recordings / "dart_rc_car" / "rubber_free_mid_100228.csv.gz")
    found = steering_lag(log, body_motion(log, CAR))
    both = found.derived(found.values["lag"] + found.values["delay"], {"lag": 1.0, "delay": 1.0})
    assert both.lower < 0.08 < both.upper
    assert both.sd < 0.015
