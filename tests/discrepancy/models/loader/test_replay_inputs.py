"""Replay inputs: fast changes from the driver's demands, the rest from the sensors."""

from dataclasses import replace

import numpy as np
import pytest

from bench.loader_truth import Arm, record
from dbc import loader_database
from discrepancy.model.description import Window
from discrepancy.models.loader.channels import INPUTS, LIMITS, OPTIONAL, SPEEDS, TORQUES
from discrepancy.models.loader.recorded_run import load_run
from discrepancy.models.loader.replay_inputs import (
    DEMANDS,
    LINKAGE,
    demanded_joints,
    first_order_lag,
    measured_rows,
    replay_inputs,
    torque_errors,
    wheel_speeds,
    without_sensor_errors,
)
from discrepancy.signals.resampling import resampled
from hil.compose import Choice
from hil.rundir import RunDirectory
from hil.runs import run_lockstep
from plant.replay import M_ARTICULATION, M_LIFT, M_SPEED, M_TORQUE
from plant.sheets.machine import load_machine
from plant.unit.actuators import abilities_of
from plant.unit.equipment import load_equipment

L60 = load_machine("l60")
EQUIPMENT = load_equipment("l60")
ABILITIES = abilities_of(L60, EQUIPMENT.actuators)
STEP_S = 0.01
TIME_S = STEP_S * np.arange(800)
INNER = slice(60, -60)


def window(**known) -> Window:
    """Eight seconds of rolling at 2 rad/s, every other signal 0 unless given."""
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


def rows_of(seen: Window) -> np.ndarray:
    return replay_inputs([seen], L60, EQUIPMENT.sensors, ABILITIES).measured


def late(values: np.ndarray, name: str) -> np.ndarray:
    """As the sensor reports it: later by its sheet's delay (torque has no lag)."""
    return np.interp(TIME_S - EQUIPMENT.sensors.of(name).delay, TIME_S, values)


def test_a_first_order_lag_reaches_its_demand_exponentially():
    asked = np.where(TIME_S >= 1.0, 1.0, 0.0)[:, None]
    given = first_order_lag(asked, 0.05, np.inf, STEP_S)[:, 0]
    np.testing.assert_allclose(
        given[100:], 1.0 - np.exp(-(TIME_S[100:] - 0.99) / 0.05), atol=1e-9
    )  # held since the row before
    assert np.max(np.diff(first_order_lag(asked, 0.05, 4.0, STEP_S)[:, 0])) <= 4.0 * STEP_S + 1e-12


@pytest.mark.parametrize("noise", [0.0, 60.0])
def test_the_pedal_keeps_a_torque_step_sharp_and_free_of_noise(noise):
    """A tenth of full torque at once: with the pedal known, neither its edge nor the sensor's noise reaches the model."""
    rng = np.random.default_rng(2)
    pedal = np.where((TIME_S > 2.0) & (TIME_S < 5.0), 0.1, 0.0)
    drive = L60.drive
    true = first_order_lag(
        pedal[:, None] * np.array(ABILITIES.drive_torque), drive.time_constant, drive.rate_limit, STEP_S
    )
    seen = {
        name: late(true[:, i], name) + noise * rng.normal(size=TIME_S.size) for i, name in enumerate(TORQUES)
    }
    known = rows_of(window(**seen, torque_demand=pedal))[:, M_TORQUE : M_TORQUE + 4]
    unknown = rows_of(window(**seen))[:, M_TORQUE : M_TORQUE + 4]
    assert np.max(np.abs(known - true)[INNER]) < 0.02 * np.max(true) + noise
    assert np.std((known - true)[INNER]) < 10.0 + 0.35 * noise
    assert np.max(np.abs(unknown - true)[INNER]) > 0.2 * np.max(true)


def test_a_torque_below_the_demand_is_followed():
    pedal = np.full(TIME_S.size, 0.1)
    true = np.full(TIME_S.size, 0.04) * ABILITIES.drive_torque[0]
    known = rows_of(window(**dict.fromkeys(TORQUES, true), torque_demand=pedal))
    np.testing.assert_allclose(known[INNER, M_TORQUE], true[INNER], atol=1e-6)


def pedalled(share: np.ndarray) -> np.ndarray:
    """Torque of the front left wheel [N m] for a pedal (n,), within the motors' lag and rate."""
    drive = L60.drive
    asked = share[:, None] * np.array(ABILITIES.drive_torque)
    return first_order_lag(asked, drive.time_constant, drive.rate_limit, STEP_S)[:, 0]


def input_of(pedal: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Replay's torque of the front left wheel, for a pedal and a torque as the sensor reports it."""
    known = window(**dict.fromkeys(TORQUES, torque), torque_demand=pedal)
    return rows_of(known)[INNER, M_TORQUE]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("share", [0.002, 0.0005])
def test_noise_of_a_torque_sensor_does_not_dilute_what_the_pedal_does(seed, share):
    """The true torque regressed on the input: below 1 by the share of noise in the input."""
    rng = np.random.default_rng(seed)
    pedal = share * np.sin(2.0 * np.pi * 0.7 * TIME_S)
    true = pedalled(pedal)
    given = input_of(pedal, late(true, TORQUES[0]) + 50.0 * rng.normal(size=TIME_S.size))
    assert np.std(true) < 50.0  # the noise is larger than the torque
    assert np.polyfit(given, true[INNER], 1)[0] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("factor", [0.9, 1.05])
def test_a_factor_between_pedal_and_sensor_is_kept(factor):
    """Also where the torque changes faster than the smoothed difference can follow."""
    rng = np.random.default_rng(3)
    pedal = 0.05 * np.sin(2.0 * np.pi * 3.0 * TIME_S)
    true = factor * pedalled(pedal)
    given = input_of(pedal, late(true, TORQUES[0]) + 50.0 * rng.normal(size=TIME_S.size))
    assert np.polyfit(true[INNER], given, 1)[0] == pytest.approx(1.0, abs=0.01)


def test_a_limit_that_acts_for_two_seconds_is_followed_beside_noise():
    rng = np.random.default_rng(4)
    pedal = np.full(TIME_S.size, 0.1)
    full = ABILITIES.drive_torque[0]
    limited = np.where((TIME_S > 3.0) & (TIME_S < 5.0), 0.04, 0.1) * full
    given = input_of(pedal, limited + 50.0 * rng.normal(size=TIME_S.size))
    inside = (TIME_S[INNER] > 3.4) & (TIME_S[INNER] < 4.6)
    np.testing.assert_allclose(given[inside], 0.04 * full, atol=0.01 * full)


JOINT = {
    "at rest": 0.1 + 0.0 * TIME_S,
    "slalom": 0.3 * np.sin(TIME_S),
    "to one side": np.interp(TIME_S, [2.0, 5.0], [0.0, 0.5]),
}


@pytest.mark.parametrize("motion", JOINT)
@pytest.mark.parametrize("scale", [0.0, 0.01])
def test_the_angle_shows_the_zero_error_of_its_rate(motion, scale):
    angle = JOINT[motion]
    rate = np.gradient(angle, STEP_S)
    noise = 3e-4 * np.random.default_rng(5).normal(size=(2, TIME_S.size))
    silent = {
        name: replace(EQUIPMENT.sensors.of(name), lag=0.0, delay=0.0)
        for name in ("articulation_angle", "articulation_rate")
    }
    sensors = replace(EQUIPMENT.sensors, channels={**EQUIPMENT.sensors.channels, **silent})
    known = window(
        articulation_angle=angle + noise[0], articulation_rate=(1.0 + scale) * rate + 2e-3 + noise[1]
    )
    undemanded = replace(known, known={k: v for k, v in known.known.items() if k not in DEMANDS})
    given = measured_rows(
        undemanded,
        wheel_speeds(undemanded, sensors),
        sensors,
        L60,
        ABILITIES,
        demanded=demanded_joints(undemanded),
    )[INNER, M_ARTICULATION + 1]
    # of 2 mrad/s less than a tenth is left; a scale error is not taken off
    assert abs(np.mean(given - (1.0 + scale) * rate[INNER])) < 2e-4


def test_brake_torque_opposes_the_rolling():
    pedal = np.where(TIME_S > 3.0, 0.2, 0.0)
    friction = first_order_lag(
        pedal[:, None] * np.array(ABILITIES.brake_torque), L60.brake.time_constant, np.inf, STEP_S
    )
    for sign in (1.0, -1.0):
        speeds = {name: np.full(TIME_S.size, sign * 2.0) for name in SPEEDS}
        seen = {name: late(-sign * friction[:, i], name) for i, name in enumerate(TORQUES)}
        known = rows_of(window(**seen, **speeds, brake_demand=pedal))[:, M_TORQUE : M_TORQUE + 4]
        np.testing.assert_allclose(known[INNER], -sign * friction[INNER], atol=0.02 * np.max(friction))


@pytest.mark.parametrize(("joint", "demand", "rate"), [(0, "lift_demand", L60.lift.raise_rate_limit)])
def test_a_lever_keeps_the_sharp_start_of_an_arm(joint, demand, rate):
    at, name, _ = LINKAGE[joint]
    assert at == M_LIFT
    lever = np.where((TIME_S > 2.0) & (TIME_S < 3.0), 0.7, 0.0)
    turning = first_order_lag(rate * lever[:, None], L60.lift.time_constant, np.inf, STEP_S)[:, 0]
    angle = STEP_S * (np.cumsum(turning) - 0.5 * turning)
    seen = {name: angle, demand: lever}
    silent = replace(EQUIPMENT.sensors.of(name), lag=0.0, delay=0.0)
    sensors = replace(EQUIPMENT.sensors, channels={**EQUIPMENT.sensors.channels, name: silent})
    known, unknown = (
        measured_rows(w, wheel_speeds(w, sensors), sensors, L60, ABILITIES, demanded=demanded_joints(w))[
            INNER, at
        ]
        - angle[INNER]
        for w in (window(**seen), window(**{name: angle}))
    )
    assert np.max(np.abs(known)) < 0.05 * np.max(np.abs(unknown))


SERVOS = {"lift": L60.lift, "tilt": L60.tilt}
LIMITED = [
    ("lift", 1.0, L60.lift.raise_rate_limit, "lift_up_limit"),
    ("lift", -1.0, L60.lift.lower_rate_limit, "lift_down_limit"),
    ("tilt", 1.0, L60.tilt.rate_limit, "tilt_back_limit"),
    ("tilt", -1.0, L60.tilt.rate_limit, "tilt_forward_limit"),
]


@pytest.mark.parametrize(("part", "sign", "fastest", "limit"), LIMITED)
def test_a_lever_that_a_limit_stops_stops_the_arm(part, sign, fastest, limit):
    """The lever stays where it is while an ECU takes the rate off: what is left is executed, sharp start and stop included."""
    joint = ("lift", "tilt").index(part)
    at, name, _ = LINKAGE[joint]
    lever = np.where((TIME_S > 2.0) & (TIME_S < 2.6), 0.5 * sign, 0.0)
    permitted = np.where(TIME_S > 2.3, 0.1 * fastest, 2.0 * fastest)
    servo = SERVOS[part]
    rate = np.clip(fastest * lever, -permitted, permitted)
    turning = first_order_lag(rate[:, None], servo.time_constant, np.inf, STEP_S)[:, 0]
    middle = 0.5 * (servo.lower_limit + servo.upper_limit)
    angle = middle + STEP_S * (np.cumsum(turning) - 0.5 * turning)
    silent = replace(EQUIPMENT.sensors.of(name), lag=0.0, delay=0.0)
    sensors = replace(EQUIPMENT.sensors, channels={**EQUIPMENT.sensors.channels, name: silent})
    seen = {name: angle, f"{part}_demand": lever}
    known, unknown = (
        measured_rows(w, wheel_speeds(w, sensors), sensors, L60, ABILITIES, demanded=demanded_joints(w))[
            INNER
        ]
        for w in (window(**seen, **{limit: permitted}), window(**seen))
    )
    np.testing.assert_allclose(known[:, at + 1], rate[INNER], atol=1e-12)
    assert np.max(np.abs(unknown[:, at + 1] - rate[INNER])) == pytest.approx(0.4 * fastest)
    errors = [np.max(np.abs(rows[:, at] - angle[INNER])) for rows in (known, unknown)]
    assert errors[0] < 0.2 * errors[1]


def test_a_limit_of_the_steering_stops_the_joint_too():
    """The joint has a rate sensor, whose noise hides a sharp stop."""
    demand = np.where((TIME_S > 2.0) & (TIME_S < 2.6), 0.3, 0.0)
    permitted = np.where(TIME_S > 2.3, 0.05, 1.0)
    turning = first_order_lag(
        np.clip(demand, -permitted, permitted)[:, None], L60.steering.time_constant, np.inf, STEP_S
    )[:, 0]
    angle = STEP_S * (np.cumsum(turning) - 0.5 * turning)
    names = ("articulation_angle", "articulation_rate")
    silent = {name: replace(EQUIPMENT.sensors.of(name), lag=0.0, delay=0.0) for name in names}
    sensors = replace(EQUIPMENT.sensors, channels={**EQUIPMENT.sensors.channels, **silent})
    seen = {**dict(zip(names, (angle, turning), strict=True)), "articulation_rate_demand": demand}
    known, unknown = (
        measured_rows(w, wheel_speeds(w, sensors), sensors, L60, ABILITIES, demanded=demanded_joints(w))[
            INNER, M_ARTICULATION
        ]
        - angle[INNER]
        for w in (window(**seen, articulation_rate_limit=permitted), window(**seen))
    )
    assert np.max(np.abs(known)) < 0.2 * np.max(np.abs(unknown))


def test_what_the_machine_obeys_is_read_from_its_bus(tmp_path):
    """In an abrupt turn the ECU takes most of the demanded rate: with its limits, and only with them, the joint turns as recorded."""
    run_lockstep(Choice(scenario="abrupt_articulation"), tmp_path / "run")
    seen, true = load_run(tmp_path / "run").signals, RunDirectory.read(tmp_path / "run").truth
    time_s = true["time_s"]
    demand = resampled(seen["articulation_rate_demand"], time_s)
    limit = resampled(seen["articulation_rate_limit"], time_s)
    lag_s, turning = L60.steering.time_constant, true["articulation_rate"]
    far_from_the_stop = np.abs(true["articulation_angle"]) < 0.8 * L60.steering.limit
    permitted, demanded = (
        np.max(
            np.abs(first_order_lag(rate[:, None], lag_s, np.inf, STEP_S)[:, 0] - turning)[far_from_the_stop]
        )
        for rate in (np.clip(demand, -limit, limit), demand)
    )
    # what the bus rounds, and nothing for a limit that is a tick early or late
    steps = [
        loader_database().by_name[message].by_signal[signal].scale
        for message, signal in (("DriverDemand", "ArticulationRateDemand"), ("Limits", "ArticulationRate"))
    ]
    assert permitted < np.radians(max(steps))
    assert demanded > 0.1
    # in force until the next one comes
    assert {seen[name].held for name in LIMITS} == {True}


FAULT = SPEEDS[0]
FAULTS = {
    "scale": lambda true: 1.03 * true,
    "delay": lambda true: np.interp(TIME_S - 0.03, TIME_S, true),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("recorded", [SPEEDS, SPEEDS[:2]])
def test_a_known_fault_of_a_wheel_speed_is_corrected(fault, recorded):
    true = 2.0 + np.sin(TIME_S)
    speeds = dict.fromkeys(recorded, true)
    sound = window(**speeds)
    faulty = replace(sound, known={**sound.known, FAULT: FAULTS[fault](true)})
    lost = {name: sound.known[name] for name in INPUTS}
    sound, faulty = (replace(w, known={**lost, **{n: w.known[n] for n in recorded}}) for w in (sound, faulty))
    ends = np.array([0, 400, TIME_S.size])

    def speed(seen: Window, **values: float) -> np.ndarray:
        errors = {f"{FAULT}.{name}": value for name, value in values.items()}
        inputs = replace(replay_inputs([seen], L60, EQUIPMENT.sensors, ABILITIES), edges=ends)
        return without_sensor_errors(inputs, errors)[:, M_SPEED]

    known = speed(faulty, **{fault: 0.03})
    edges = np.r_[0:60, 340:460, 740:800]  # segments are read as if nothing came before or after
    np.testing.assert_allclose(np.delete(known - speed(sound), edges), 0.0, atol=2e-4)
    assert np.max(np.abs(speed(faulty) - speed(sound))) > 0.0299 / len(recorded)


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A random drive through driver, limits, sensors and CAN: replay inputs and true values at the same times."""
    folder = tmp_path_factory.mktemp("runs") / "drive"
    record(Arm(seed=2, duration_s=30.0), folder)
    seen, true = load_run(folder).signals, RunDirectory.read(folder).truth
    time_s = STEP_S * np.arange(3000)
    known = {
        name: resampled(s, time_s)
        for name, s in seen.items()
        if name in (*INPUTS, *OPTIONAL, *LIMITS, *SPEEDS)
    }
    whole = replace(window(), time_s=time_s, end_s=float(time_s[-1]), known=known)
    return rows_of(whole)[INNER], {
        name: np.asarray(values)[: len(time_s)][INNER] for name, values in true.items()
    }


def test_bench_torque_is_known_to_half_its_sensors_noise(driven):
    """But for the sensor's gain of 2 %, which a nuisance takes: with brakes, turns and limits in it."""
    known, true = driven
    torque = known[:, M_TORQUE : M_TORQUE + 4]
    gain = np.sum(torque * true["wheel_torque"]) / np.sum(true["wheel_torque"] ** 2)
    assert gain == pytest.approx(1.0 + EQUIPMENT.sensors.of(TORQUES[0]).scale_error, abs=3e-3)
    assert np.std(torque / gain - true["wheel_torque"]) < 0.5 * EQUIPMENT.sensors.of(TORQUES[0]).noise


def test_bench_arm_angle_is_known_to_half_its_sensors_noise(driven):
    known, true = driven
    sheet = EQUIPMENT.sensors.of("lift_arm_angle")
    error = known[:, M_LIFT] - true["lift_arm_angle"] - sheet.bias
    assert np.ptp(true["lift_arm_angle"]) > 0.1, "the drive does not lift"
    assert np.std(error) < 0.5 * sheet.noise
    assert abs(np.mean(error)) < 0.5 * sheet.noise


@pytest.mark.parametrize("pulse", [0.0, 0.3], ids=["even", "varying"])
def test_noise_leaves_the_torques_as_uncertain_as_is_said(pulse: float) -> None:
    """Recordings of one drive that differ in noise only: the sum of their torques scatters by what `torque_errors` says."""
    pedal = 0.1 + pulse * (np.abs(TIME_S - 4.0) < 0.5)
    true, rng, sums = pedalled(pedal), np.random.default_rng(3), []
    for _ in range(300):
        noisy = {name: late(true, name) + rng.normal(0.0, 60.0, TIME_S.size) for name in TORQUES}
        seen = window(torque_demand=pedal, **noisy)
        sums.append(rows_of(seen)[:, M_TORQUE : M_TORQUE + 4].sum(axis=1))
    said = np.linalg.norm(4.0 * torque_errors(seen, L60, ABILITIES), axis=1)
    scatter = np.array(sums) - np.mean(sums, axis=0)
    for rows in (np.abs(TIME_S - 4.0) > 2.0, np.abs(TIME_S - 4.0) < 0.3):
        assert np.std(scatter[:, rows].mean(axis=1)) == pytest.approx(said[rows].mean(), rel=0.2)


def test_an_uncertain_torque_moves_all_wheels_alike() -> None:
    """One standard deviation of the offset is the same torque in every row; that of the factor goes with the torque, and changes its sign."""
    pedal = 0.1 + 0.3 * (np.abs(TIME_S - 4.0) < 0.5)
    noise = np.random.default_rng(4).normal(0.0, 60.0, TIME_S.size)
    inputs = replay_inputs(
        [window(torque_demand=pedal, **dict.fromkeys(TORQUES, pedalled(pedal) + noise))],
        L60,
        EQUIPMENT.sensors,
        ABILITIES,
    )

    def added(name: str) -> np.ndarray:
        more, none = without_sensor_errors(inputs, {name: 1.0}), without_sensor_errors(inputs, {})
        return (more - none)[:, M_TORQUE : M_TORQUE + 4]

    # four independent sensors with a noise of 60 N m, the mean of 800 rows each
    np.testing.assert_allclose(added("initial.torque_offset"), 60.0 / np.sqrt(4 * TIME_S.size), rtol=0.1)
    factor = added("initial.torque_factor")
    assert factor[400, 0] > 0.0 > factor[100, 0]
    np.testing.assert_allclose(factor, factor[:, :1] * np.ones(4))
