"""A plant led by what another one did does the same."""

import math

import numpy as np
import pytest

from plant import replay as f
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from plant.truth import columns_of

L60 = load_machine("l60")
ACCURACY = {  # what the bench's own sensors and instruments resolve
    "wheel_speed": 0.005,
    "imu_specific_force": 0.03,
    "angular_velocity": 0.002,
    "normal_force": 50.0,
    "lateral_force": 50.0,
    "lift_pressure": 2e4,
    "pitch": 5e-4,
}


def drive(seconds=6.0):
    """Truth of a drive with steps of torque, steering to both sides, a lift and a stop: columns, 10 ms apart."""
    plant = Plant(L60, speed=3.0)
    rows = [plant.truth().row]
    for k in range(round(seconds * 100)):
        t = 0.01 * k
        torque = 2500.0 if 0.5 < t < 2.0 else (-2000.0 if 2.5 < t < 3.5 else 0.0)
        commands = Commands(
            wheel_torque=(torque,) * 4,
            brake_torque=(4000.0 if t > 4.5 else 0.0,) * 4,
            articulation_rate=0.25 * math.sin(2.0 * t),
            lift_rate=0.1 if 1.0 < t < 3.0 else 0.0,
        )
        plant.advance(commands, 0.01)
        rows.append(plant.truth().row)
    return columns_of(np.array(rows))


def measured(truth, braking):
    out = np.zeros((len(truth["time_s"]), f.MEASURED))
    out[:, f.M_TORQUE : f.M_TORQUE + 4] = truth["wheel_torque"]
    out[:, f.M_BRAKING] = braking
    out[:, f.M_SPEED] = truth["wheel_speed"].mean(axis=1)
    out[:, f.M_TURNING : f.M_TURNING + 4] = truth["wheel_speed"]
    for at, name in ((f.M_ARTICULATION, "articulation"), (f.M_LIFT, "lift_arm"), (f.M_TILT, "tilt")):
        out[:, at], out[:, at + 1] = truth[f"{name}_angle"], truth[f"{name}_rate"]
    return out


@pytest.fixture(scope="module")
def truth():
    return drive()


def led(truth, given=L60, **options):
    rows = measured(truth, truth["time_s"] > 4.5)
    return f.follow(Plant(given, speed=3.0), rows, interval_s=0.01, **options)[0]


@pytest.mark.parametrize("step", [1e-3, 2e-3, 5e-3])
def test_it_does_what_the_leader_did_to_the_accuracy_of_the_sensors(truth, step):
    found = led(truth, step_s=step)
    columns = columns_of(found)
    for name, accuracy in ACCURACY.items():
        error = float(np.sqrt(np.mean((columns[name] - truth[name]) ** 2)))
        assert error < accuracy * (2.0 if step > 2e-3 else 1.0), name


def test_through_the_demanded_rates_accelerations_are_those_of_the_leader(truth):
    """Cylinders that are asked for the same do the same, however much coarser the steps."""
    rows = measured(truth, truth["time_s"] > 4.5)
    asked = np.arange(len(rows)) - 1  # a row holds what the tick before it was asked for
    rows[1:, f.M_ARTICULATION + 1] = 0.25 * np.sin(0.02 * asked[1:])
    rows[0, f.M_ARTICULATION + 1] = 0.0
    rows[:, f.M_LIFT + 1] = np.where((asked > 100) & (asked < 300), 0.1, 0.0)
    rows[:, f.M_TILT + 1] = 0.0
    found = f.follow(Plant(L60, speed=3.0), rows, interval_s=0.01, step_s=5e-3, demanded=(True, True, True))[
        0
    ]
    lateral = columns_of(found)["imu_specific_force"][:, 1] - truth["imu_specific_force"][:, 1]
    steering = np.gradient(truth["articulation_rate"], 0.01)
    assert np.std(lateral) < 0.005
    assert abs(np.polyfit(steering, lateral, 1)[0]) < 0.005  # of a lever of 1.76 m


def test_forces_are_not_late_for_the_torque():
    """Half a step of 5 ms would show as 2.5 ms times the slope of the torque."""
    plant = Plant(L60, speed=3.0, integrator="rk4")
    rows = [plant.truth().row]
    for k in range(300):
        plant.advance(Commands(wheel_torque=(2000.0 * math.sin(0.03 * k),) * 4), 0.01)
        rows.append(plant.truth().row)
    leader = columns_of(np.array(rows))
    found = f.follow(Plant(L60, speed=3.0), measured(leader, 0.0), interval_s=0.01, step_s=5e-3)[0]
    missing = (leader["longitudinal_force"] - columns_of(found)["longitudinal_force"])[20:-1, 0]
    slope = np.gradient(leader["wheel_torque"][:, 0], 0.01)[20:-1] / L60.tyre.radius
    assert abs(np.polyfit(slope, missing, 1)[0]) < 1e-3


@pytest.mark.parametrize("forward", [1.0, -1.0])
def test_a_motor_that_drives_against_a_brake_still_let_off_is_not_taken_for_the_brake(forward):
    """The pedal is just touched while the torque is with the rolling: what was measured drives, as much as without the pedal."""
    speed, rows = forward * 3.0, []
    plant = Plant(L60, speed=speed)
    for _ in range(100):
        rows.append(plant.truth().row)
        plant.advance(Commands(wheel_torque=(forward * 2000.0,) * 4), 0.01)
    leader = columns_of(np.array(rows))
    touched, free = (
        columns_of(f.follow(Plant(L60, speed=speed), measured(leader, pedal), interval_s=0.01)[0])
        for pedal in (1.0, 0.0)
    )
    np.testing.assert_array_equal(touched["speed"][10:], free["speed"][10:])
    assert forward * touched["speed"][-1] > forward * touched["speed"][10] + 0.1


def test_a_wheel_that_its_brake_locks_stands_where_the_others_roll():
    """Its torque is what the road gives it, not what the brake could: only its speed shows a lock."""
    plant, rows = Plant(L60, speed=3.0, integrator="rk4"), []
    for k in range(150):
        rows.append(plant.truth().row)
        plant.advance(Commands(brake_torque=(4000.0, 4000.0, 30e3, 30e3) if k > 50 else (0.0,) * 4), 0.01)
    leader = columns_of(np.array(rows))
    locked = (np.abs(leader["wheel_speed"][:, 2]) < 1e-9) & (leader["speed"] > 0.5)
    assert locked.sum() > 20
    found = columns_of(
        f.follow(Plant(L60, speed=3.0), measured(leader, leader["time_s"] > 0.5), interval_s=0.01)[0]
    )
    assert np.abs(found["wheel_speed"][locked, 2][3:]).max() < 1e-9
    assert np.abs(found["wheel_speed"][locked, 0] - leader["wheel_speed"][locked, 0]).max() < 0.05
    assert np.abs(found["speed"] - leader["speed"])[locked].max() < 0.03


def test_an_error_of_force_shows_as_a_steady_difference_of_speed(truth):
    """Resistance the leader did not have, over mass and gain, is what the speed is off by."""
    from dataclasses import replace

    from plant.effects import find_effect

    drag = find_effect("brake_drag").of(front_N_m=300.0, rear_N_m=300.0)
    columns = columns_of(led(truth, replace(L60, effects=(drag,))))
    coasting = slice(400, 440)
    off = (columns["wheel_speed"] - truth["wheel_speed"])[coasting].mean() * 0.727
    steady = -4 * 300.0 / 0.727 / (11842.0 + 4 * 110.0 / 0.73**2) / f.GAIN
    expected = steady * (1.0 - math.exp(-f.GAIN * 4.2))
    assert off == pytest.approx(expected, rel=0.15)


def test_a_motion_that_diverges_is_reported(truth):
    rows = measured(truth, truth["time_s"] > 4.5)
    rows[100, f.M_ARTICULATION + 1] = math.inf
    led_rows, states = f.follow(Plant(L60, speed=3.0), rows, interval_s=0.01)
    assert np.isfinite(led_rows[:100]).all()
    assert not np.isfinite(led_rows[-1]).all()
    assert not np.isfinite(states[-1]).any()


def test_the_plant_that_leads_in_is_left_as_it_was(truth):
    plant = Plant(L60, speed=3.0)
    before = plant.truth().row.copy()
    f.follow(plant, measured(truth, truth["time_s"] > 4.5), interval_s=0.01)
    np.testing.assert_array_equal(plant.truth().row, before)
