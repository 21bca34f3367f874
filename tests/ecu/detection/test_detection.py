"""Faults of sensors in a machine that drives straight: noticed, named, gone on without; none where there is none."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ecu.calibration import load_calibration
from ecu.codes import Mode
from ecu.cycle import EcuCycle
from ecu.detection.layout import JUMP
from ecu.detection.rules import FAMILIES, PREDICTED, height_for
from ecu.findings import EstimatorFailed, FaultFound
from ecu.states import State
from ecu.watched import NAMES, PLACE
from tests.ecu.machine import FakeMachine, decoded, play

CALIBRATION = load_calibration()
SPEED, RADIUS = 3.0, 0.727
ROLLING = {f"wheel_speed_{n}": SPEED / RADIUS for n in range(1, 5)}


class NoisyMachine(FakeMachine):
    """A machine that rolls straight ahead on level ground, with the noise of its sensors; `wrong` changes one value."""

    def __init__(self, seed=1, **values):
        super().__init__(**(ROLLING | values))
        self.sound = dict(self.values)
        self.generator = np.random.default_rng(seed)
        self.wrong = {}

    def frames(self):
        for name in NAMES:
            # the slope sensor's rate is the gyro's own on this machine
            if name == "slope_pitch_rate":
                continue
            sensor = CALIBRATION.detection.sensors[FAMILIES[name]]
            value = self.sound[name] + sensor.noise * self.generator.standard_normal()
            self.values[name] = self.wrong[name](value, self.tick) if name in self.wrong else value
        return super().frames()


def started(seed=1, **values):
    ecu, machine = EcuCycle(CALIBRATION, detect_faults=True), NoisyMachine(seed, **values)
    play(ecu, machine, 250)
    return ecu, machine


def faults(findings):
    return [f for f in findings if isinstance(f, FaultFound)]


def jump_of(ecu, name):
    return ecu._detection._rules[JUMP, PLACE[name]]


SIGNALS = [name for name in NAMES if name not in ("slope_pitch_rate", "pitch_rate")]
"""One gyro feeds the two pitch rates of this machine: a fault of it looks like a shock."""


def test_a_sound_machine_has_no_fault():
    ecu, machine = started(seed=3)
    _, findings = play(ecu, machine, 1500)
    assert faults(findings) == []


@pytest.mark.parametrize("times", [2.0, 6.0])
@pytest.mark.parametrize("name", SIGNALS)
def test_an_offset_is_noticed_and_named_within_a_tenth_of_a_second(name, times):
    ecu, machine = started()
    size = times * jump_of(ecu, name)
    machine.wrong[name] = lambda value, tick: value + size
    _, findings = play(ecu, machine, 10)
    assert [f.signals for f in faults(findings)] == [(name,)]
    assert faults(findings)[0].mode is Mode.RATE_OF_CHANGE


@pytest.mark.parametrize("name", SIGNALS)
def test_a_spike_is_a_fault_that_ends(name):
    ecu, machine = started()
    size = 2.0 * jump_of(ecu, name)
    at = machine.tick + 4
    machine.wrong[name] = lambda value, tick: value + size if at <= tick < at + 2 else value
    _, findings = play(ecu, machine, 30)
    assert [f.signals for f in faults(findings)] == [(name,)]
    assert ecu._detection._known == frozenset()
    assert [code.name for code in ecu._troubles.codes.active] == [name]


@pytest.mark.parametrize("name", SIGNALS)
def test_a_signal_that_stands_still_is_named(name):
    ecu, machine = started()
    held = machine.sound[name]
    machine.wrong[name] = lambda value, tick: held
    _, findings = play(ecu, machine, 60)
    found = {(f.signals, f.mode) for f in faults(findings)}
    assert found == {((name,), Mode.NOT_RESPONDING)}


def test_exchanged_sensors_are_both_named():
    ecu, machine = started()
    apart = 3.0 * jump_of(ecu, "wheel_speed_1")
    machine.wrong["wheel_speed_1"] = lambda value, tick: value + apart
    machine.wrong["wheel_speed_2"] = lambda value, tick: value - apart
    _, findings = play(ecu, machine, 10)
    assert {(f.signals, f.mode) for f in faults(findings)} == {
        (("wheel_speed_1",), Mode.EXCHANGED),
        (("wheel_speed_2",), Mode.EXCHANGED),
    }


def test_a_shock_that_several_sensors_feel_is_no_fault():
    ecu, machine = started()
    size = 3.0 * jump_of(ecu, "specific_force_z")
    turn = 3.0 * jump_of(ecu, "pitch_rate")
    at = machine.tick + 5
    machine.wrong["specific_force_z"] = lambda value, tick: value + size * (tick == at)
    machine.wrong["pitch_rate"] = lambda value, tick: value + turn * (tick == at)
    _, findings = play(ecu, machine, 100)
    assert faults(findings) == []


@pytest.mark.parametrize(("later", "fault"), [(0, False), (3, False), (12, True)])
def test_a_jump_waits_for_the_rest_of_the_machine_to_explain_it(later, fault):
    """A wheel on a kerb: it turns before gyro and accelerometer have felt anything; what comes too late explains nothing."""
    ecu, machine = started()
    at = machine.tick + 5
    for name, when in (("wheel_speed_1", at), ("roll_rate", at + later), ("specific_force_z", at + later)):
        size = 3.0 * jump_of(ecu, name)
        machine.wrong[name] = lambda value, tick, size=size, when=when: value + size * (tick == when)
    _, findings = play(ecu, machine, 11)
    assert [f.signals for f in faults(findings)] == ([("wheel_speed_1",)] if fault else [])


@pytest.mark.parametrize(("speed", "fault"), [(0.0, []), (SPEED / RADIUS, [("wheel_torque_3",)])])
def test_a_brake_that_grips_a_wheel_is_no_fault_of_its_torque(speed, fault):
    """A held wheel reports its drive's torque alone: the signal jumps when the wheel comes to rest, and nothing else moves."""
    ecu, machine = started(**{f"wheel_speed_{n}": speed for n in range(1, 5)})
    machine.wrong["wheel_torque_3"] = lambda value, tick: value + 3.2e3
    _, findings = play(ecu, machine, 100)
    assert [f.signals for f in faults(findings)] == fault


def yaw_moments(times, detect_faults=True):
    """Estimates of four cycles that begin with a jump of the gyro, in multiples of the smallest one; and the findings."""
    ecu, machine = EcuCycle(CALIBRATION, detect_faults=detect_faults), NoisyMachine()
    play(ecu, machine, 250)
    size = times * jump_of(started()[0], "yaw_rate")
    machine.wrong["yaw_rate"] = lambda value, tick: value + size
    results, findings = play(ecu, machine, 4)
    return np.array([result.estimates.yaw_moment for result in results]), faults(findings)


@pytest.mark.parametrize("times", [1.5, 4.0, 20.0])
def test_a_jump_that_waits_is_kept_from_the_estimators(times):
    """The yaw moment follows from the gyro's change: while the jump waits, only the noise of its sample is left of it."""
    noise = PREDICTED * CALIBRATION.detection.sensors[FAMILIES["yaw_rate"]].noise
    sound, _ = yaw_moments(0.0)
    waiting, found = yaw_moments(times)
    let_in, _ = yaw_moments(times, detect_faults=False)
    jump = times * jump_of(started()[0], "yaw_rate")
    assert found == []
    # five standard deviations of the one innovation that the jump is taken for
    assert max(abs(waiting - sound)) < 5.0 * noise / jump * max(abs(let_in - sound))


def test_a_gyro_that_jumps_does_not_accuse_the_slope():
    """Nor when it jumps back, nor when the offset is believed at last: the slope's prediction goes on without the jump."""
    for ticks in (100, 1100):
        ecu, machine = started()
        size = 8.0 * jump_of(ecu, "yaw_rate")
        machine.wrong["yaw_rate"] = lambda value, tick, size=size: value + size
        _, findings = play(ecu, machine, ticks)
        del machine.wrong["yaw_rate"]
        findings += play(ecu, machine, 100)[1]
        assert {f.signals for f in faults(findings)} == {("yaw_rate",)}


def test_a_slow_drift_of_a_wheel_is_found_by_its_residuals():
    ecu, machine = started()
    begin = machine.tick
    machine.wrong["wheel_speed_3"] = lambda value, tick: value + 0.3 * (tick - begin) / 100
    _, findings = play(ecu, machine, 250)
    assert any("wheel_speed_3" in f.signals for f in faults(findings))
    assert all("wheel_speed_3" in f.signals for f in faults(findings))


def test_a_slow_drift_does_not_distinguish_angle_from_rate():
    """With the machine straight ahead both explain the observer's residual: both are named, and neither alone."""
    ecu, machine = started()
    begin = machine.tick
    machine.wrong["roll"] = lambda value, tick: value + math.radians(1.5) * (tick - begin) / 100
    _, findings = play(ecu, machine, 200)
    first = faults(findings)[0]
    assert {"roll", "roll_rate"} <= set(first.signals)
    assert first.mode is Mode.ROOT_CAUSE_NOT_KNOWN


def test_with_one_pressure_wrong_the_loads_go_on():
    ecu, machine = started()
    before, _ = play(ecu, machine, 20)
    machine.wrong["tilt_pressure"] = lambda value, tick: value + 4e6
    results, _ = play(ecu, machine, 300)
    front = [sum(r.estimates[:2]) for r in (before[-1], results[-1])]
    assert front[1] == pytest.approx(front[0], rel=0.03)
    newest = {}
    for result in results[-4:]:
        newest |= decoded(result.frames)
    assert newest["NormalForces"]["FrontLeftValid"] == 1
    assert ecu.state is State.RUNNING


@pytest.mark.parametrize(("name", "rough"), [("wheel_speed_4", 0.02), ("yaw_rate", 0.03), ("roll", 0.03)])
def test_without_a_wheel_gyro_or_slope_the_loads_go_on(name, rough):
    ecu, machine = started()
    before, _ = play(ecu, machine, 20)
    machine.wrong[name] = lambda value, tick: value + 5.0 * jump_of(ecu, name)
    results, _ = play(ecu, machine, 300)
    for k in range(4):
        assert results[-1].estimates[k] == pytest.approx(before[-1].estimates[k], rel=rough)
    newest = {}
    for result in results[-4:]:
        newest |= decoded(result.frames)
    assert newest["NormalForces"]["FrontLeftValid"] == 1


def test_a_replacement_that_cannot_be_computed_is_a_finding_and_not_the_end(monkeypatch):
    """The levers of a linkage may stand so that a pressure says nothing of the other: the detection begins anew, the ECU goes on."""
    ecu, machine = started()

    def divided(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("ecu.detection.live.pressure_from_other", divided)
    machine.wrong["lift_pressure"] = lambda value, _: value + 3e6
    _, findings = play(ecu, machine, 200)
    failed = [f for f in findings if isinstance(f, EstimatorFailed)]
    assert failed
    assert "fault detection" in failed[0].error
    monkeypatch.undo()
    machine.wrong.clear()
    play(ecu, machine, 400)
    assert ecu.state is State.RUNNING


def test_a_signal_of_no_known_family_is_not_judged(monkeypatch):
    """Who adds a sensor need not describe its noise at once: neither a jump nor a standstill of it is a fault, those of others are."""
    known = {name: family for name, family in FAMILIES.items() if name != "tilt_angle"}
    others, _ = started()
    jump, size = jump_of(others, "tilt_angle"), 2.0 * jump_of(others, "yaw_rate")
    monkeypatch.setattr("ecu.detection.rules.FAMILIES", known)
    ecu, machine = started()
    monkeypatch.undo()
    machine.wrong["tilt_angle"] = lambda value, tick: value + 2.0 * jump
    _, findings = play(ecu, machine, 10)
    assert faults(findings) == []
    machine.wrong["yaw_rate"] = lambda value, tick: value + size
    _, findings = play(ecu, machine, 10)
    assert [f.signals for f in faults(findings)] == [("yaw_rate",)]


def test_a_fault_that_ends_leaves_a_previous_code_and_a_running_ecu():
    ecu, machine = started()
    machine.wrong["articulation_angle"] = lambda value, tick: value + math.radians(3.0)
    play(ecu, machine, 300)
    assert ecu.state is State.DEGRADED
    del machine.wrong["articulation_angle"]
    play(ecu, machine, 150)
    assert ecu.state is State.RUNNING
    assert [code.name for code in ecu._troubles.codes.previous] == ["articulation_angle"]


def test_a_fault_stays_known_when_a_parameter_changes():
    ecu, machine = started()
    size = 2.0 * jump_of(ecu, "wheel_speed_2")
    machine.wrong["wheel_speed_2"] = lambda value, tick: value + size
    play(ecu, machine, 10)
    parameters = CALIBRATION.parameters
    bucket = parameters.bucket._replace(mass=1.02 * parameters.bucket.mass)
    ecu.recalibrate(replace(CALIBRATION, parameters=parameters._replace(bucket=bucket)))
    _, findings = play(ecu, machine, 200)
    # a detection that began anew would take the shifted wheel for a sound one that it has never seen otherwise
    assert faults(findings) == []
    assert "wheel_speed_2" in ecu._detection._known


def test_the_height_gives_the_run_length_that_is_asked_for():
    """A CUSUM of white noise with a height for a false alarm per second: counted in 400 s of one residual."""
    from ecu.detection.layout import RESIDUALS

    per_hour = 2.0 * RESIDUALS * 3600.0  # one per second and one-sided test
    height = height_for(per_hour)
    noise = np.random.default_rng(5).standard_normal(40_000)
    alarms, total = 0, 0.0
    for value in noise:
        total = max(0.0, total + value - 0.5)
        if total > height:
            alarms, total = alarms + 1, 0.0
    assert alarms == pytest.approx(400, rel=0.25)
