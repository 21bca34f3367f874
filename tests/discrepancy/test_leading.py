"""What leads the plant: quick changes from the driver's demands, the rest from the sensors."""

from dataclasses import replace

import numpy as np
import pytest

from bench.loader_truth import Arm, record
from discrepancy.model import Window
from discrepancy.models.leading import LINKAGE, asked_of, followed, measured_of, shifted, speeds_of
from discrepancy.models.loader import load_run
from discrepancy.models.loader_library import INPUTS, OPTIONAL, SPEEDS, TORQUES
from discrepancy.windows import resampled
from hil.rundir import RunDirectory
from plant.actuators import abilities_of
from plant.equipment import load_equipment
from plant.follow import M_LIFT, M_SPEED, M_TORQUE
from plant.machine import load_machine

L60 = load_machine("l60")
EQUIPMENT = load_equipment("l60")
ABILITIES = abilities_of(L60, EQUIPMENT.actuators)
STEP_S = 0.01
TIME_S = STEP_S * np.arange(800)
INNER = slice(60, -60)


def window(**known) -> Window:
    """Eight seconds of rolling at 2 rad/s, everything else at zero unless told."""
    signals = {**dict.fromkeys(INPUTS, 0.0 * TIME_S), **dict.fromkeys(SPEEDS, 2.0 + 0.0 * TIME_S), **known}
    return Window(
        recording="drive",
        start_s=0.0,
        end_s=float(TIME_S[-1]),
        time_s=TIME_S,
        step_s=STEP_S,
        known=signals,
        constants={},
    )


def led(seen: Window) -> np.ndarray:
    speeds = speeds_of(seen, EQUIPMENT.sensors)
    return measured_of(seen, speeds, EQUIPMENT.sensors, L60, ABILITIES, asked=asked_of(seen))


def late(values: np.ndarray, name: str) -> np.ndarray:
    """As the sensor reports it: later by its sheet's delay (torque has no lag)."""
    return np.interp(TIME_S - EQUIPMENT.sensors.of(name).delay, TIME_S, values)


def test_a_first_order_lag_ends_where_it_is_asked_to_and_takes_its_time():
    asked = np.where(TIME_S >= 1.0, 1.0, 0.0)[:, None]
    given = followed(asked, 0.05, np.inf, STEP_S)[:, 0]
    np.testing.assert_allclose(
        given[100:], 1.0 - np.exp(-(TIME_S[100:] - 0.99) / 0.05), atol=1e-9
    )  # held since the row before
    assert np.max(np.diff(followed(asked, 0.05, 4.0, STEP_S)[:, 0])) <= 4.0 * STEP_S + 1e-12


@pytest.mark.parametrize("noise", [0.0, 60.0])
def test_the_pedal_tells_what_no_filter_could_of_a_torque_step(noise):
    """A tenth of full torque at once: with the pedal known, neither its edge nor the sensor's noise reaches the model."""
    rng = np.random.default_rng(2)
    pedal = np.where((TIME_S > 2.0) & (TIME_S < 5.0), 0.1, 0.0)
    drive = L60.drive
    true = followed(
        pedal[:, None] * np.array(ABILITIES.drive_torque), drive.time_constant, drive.rate_limit, STEP_S
    )
    seen = {
        name: late(true[:, i], name) + noise * rng.normal(size=TIME_S.size) for i, name in enumerate(TORQUES)
    }
    told = led(window(**seen, torque_demand=pedal))[:, M_TORQUE : M_TORQUE + 4]
    guessed = led(window(**seen))[:, M_TORQUE : M_TORQUE + 4]
    assert np.max(np.abs(told - true)[INNER]) < 0.02 * np.max(true) + noise
    assert np.std((told - true)[INNER]) < 10.0 + 0.35 * noise
    assert np.max(np.abs(guessed - true)[INNER]) > 0.2 * np.max(true)


def test_a_torque_that_limits_take_off_is_believed_all_the_same():
    pedal = np.full(TIME_S.size, 0.1)
    true = np.full(TIME_S.size, 0.04) * ABILITIES.drive_torque[0]
    told = led(window(**dict.fromkeys(TORQUES, true), torque_demand=pedal))
    np.testing.assert_allclose(told[INNER, M_TORQUE], true[INNER], atol=1e-6)


def test_the_brake_pedal_tells_what_opposes_the_rolling():
    pedal = np.where(TIME_S > 3.0, 0.2, 0.0)
    friction = followed(
        pedal[:, None] * np.array(ABILITIES.brake_torque), L60.brake.time_constant, np.inf, STEP_S
    )
    for sign in (1.0, -1.0):
        speeds = {name: np.full(TIME_S.size, sign * 2.0) for name in SPEEDS}
        seen = {name: late(-sign * friction[:, i], name) for i, name in enumerate(TORQUES)}
        told = led(window(**seen, **speeds, brake_demand=pedal))[:, M_TORQUE : M_TORQUE + 4]
        np.testing.assert_allclose(told[INNER], -sign * friction[INNER], atol=0.02 * np.max(friction))


@pytest.mark.parametrize(("joint", "demand", "rate"), [(0, "lift_demand", L60.lift.raise_rate_limit)])
def test_an_arm_that_starts_at_once_is_led_without_a_rounded_corner(joint, demand, rate):
    at, name, _ = LINKAGE[joint]
    assert at == M_LIFT
    lever = np.where((TIME_S > 2.0) & (TIME_S < 3.0), 0.7, 0.0)
    turning = followed(rate * lever[:, None], L60.lift.time_constant, np.inf, STEP_S)[:, 0]
    angle = STEP_S * (np.cumsum(turning) - 0.5 * turning)
    seen = {name: angle, demand: lever}
    silent = replace(EQUIPMENT.sensors.of(name), lag=0.0, delay=0.0)
    sensors = replace(EQUIPMENT.sensors, channels={**EQUIPMENT.sensors.channels, name: silent})
    told, guessed = (
        measured_of(w, speeds_of(w, sensors), sensors, L60, ABILITIES, asked=asked_of(w))[INNER, at]
        - angle[INNER]
        for w in (window(**seen), window(**{name: angle}))
    )
    assert np.max(np.abs(told)) < 0.05 * np.max(np.abs(guessed))


FAULT = SPEEDS[0]
FAULTS = {
    "scale": lambda true: 1.03 * true,
    "delay": lambda true: np.interp(TIME_S - 0.03, TIME_S, true),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("recorded", [SPEEDS, SPEEDS[:2]])
def test_a_known_fault_of_a_wheel_speed_does_not_lead_the_plant_astray(fault, recorded):
    true = 2.0 + np.sin(TIME_S)
    speeds = dict.fromkeys(recorded, true)
    sound = window(**speeds)
    faulty = replace(sound, known={**sound.known, FAULT: FAULTS[fault](true)})
    lost = {name: sound.known[name] for name in INPUTS}
    sound, faulty = (replace(w, known={**lost, **{n: w.known[n] for n in recorded}}) for w in (sound, faulty))
    ends = np.array([0, 400, TIME_S.size])

    def speed(seen: Window, **values: float) -> np.ndarray:
        told = {f"{FAULT}.{name}": value for name, value in values.items()}
        return shifted(led(seen), speeds_of(seen, EQUIPMENT.sensors), ends, told, STEP_S)[:, M_SPEED]

    known = speed(faulty, **{fault: 0.03})
    edges = np.r_[0:60, 340:460, 740:800]  # stretches are read as if nothing came before or after
    np.testing.assert_allclose(np.delete(known - speed(sound), edges), 0.0, atol=2e-4)
    assert np.max(np.abs(speed(faulty) - speed(sound))) > 0.0299 / len(recorded)


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A drive by chance through driver, limits, sensors and CAN: what leads the plant, and what was true, at the same times."""
    folder = tmp_path_factory.mktemp("runs") / "drive"
    record(Arm(seed=2, duration_s=30.0), folder)
    seen, true = load_run(folder).signals, RunDirectory.read(folder).truth
    time_s = STEP_S * np.arange(3000)
    known = {name: resampled(s, time_s) for name, s in seen.items() if name in (*INPUTS, *OPTIONAL, *SPEEDS)}
    whole = replace(window(), time_s=time_s, end_s=float(time_s[-1]), known=known)
    return led(whole)[INNER], {
        name: np.asarray(values)[: len(time_s)][INNER] for name, values in true.items()
    }


def test_on_the_bench_the_torque_is_known_to_a_fraction_of_its_sensors_noise(driven):
    """But for the sensor's gain of 2 %, which a nuisance takes: with brakes, turns and limits in it."""
    told, true = driven
    torque = told[:, M_TORQUE : M_TORQUE + 4]
    gain = np.sum(torque * true["wheel_torque"]) / np.sum(true["wheel_torque"] ** 2)
    assert gain == pytest.approx(1.0 + EQUIPMENT.sensors.of(TORQUES[0]).scale_error, abs=3e-3)
    assert np.std(torque / gain - true["wheel_torque"]) < 0.5 * EQUIPMENT.sensors.of(TORQUES[0]).noise


def test_on_the_bench_the_arm_is_where_its_sensor_says_less_noise(driven):
    told, true = driven
    sheet = EQUIPMENT.sensors.of("lift_arm_angle")
    error = told[:, M_LIFT] - true["lift_arm_angle"] - sheet.bias
    assert np.ptp(true["lift_arm_angle"]) > 0.1, "the drive does not lift"
    assert np.std(error) < 0.5 * sheet.noise
    assert abs(np.mean(error)) < 0.5 * sheet.noise
