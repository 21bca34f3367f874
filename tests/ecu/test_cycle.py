"""The cycle as a protocol: nothing before inputs, validity by the table, safe values in doubt, equal bytes for equal input."""

import dataclasses
import itertools

import pytest

from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Checker, Finding
from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle
from ecu.estimators.signals import NEVER
from ecu.findings import EstimatorFailed, Implausible, ProtectionFailed, Stale, StateChanged
from ecu.inputs import WEIGHTLESS
from ecu.states import State
from ecu.validity import NEEDS
from tests.ecu.machine import MESSAGES, PERIOD_NS, FakeMachine, decoded, play

CALIBRATION = load_calibration()


def cycle(**options):
    return EcuCycle(CALIBRATION, **options)


def last_values(results):
    """The newest content of every message of the ECU."""
    newest = {}
    for result in results:
        newest |= decoded(result.frames)
    return newest


def flags(values):
    """Validity as sent, by the names of the validity table."""
    wheels = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
    return {
        "normal": bool(values["NormalForces"]["FrontLeftValid"]),
        "roll_over": bool(values["RollOver"]["Valid"]),
        "joint_torque": bool(values["TurningTorque"]["TorqueValid"]),
        "yaw_moment": bool(values["TurningTorque"]["MomentValid"]),
        "payload": bool(values["BodyMotion"]["PayloadValid"]),
        "speed": bool(values["BodyMotion"]["SpeedValid"]),
        **{f"slip_{n}": bool(values[f"TyreForce{w}"]["SlipValid"]) for n, w in enumerate(wheels, 1)},
        **{f"force_{n}": bool(values[f"TyreForce{w}"]["ForceValid"]) for n, w in enumerate(wheels, 1)},
    }


def test_nothing_is_valid_before_the_machine_is_heard():
    ecu = cycle()
    results = [ecu.tick(k * PERIOD_NS) for k in range(50)]
    values = last_values(results)
    assert not any(flags(values).values())
    assert values["EcuStatus"]["State"] == State.INIT
    assert values["Limits"]["Cause"] == 3
    assert values["RollOver"]["State"] == 7


def test_a_standing_machine_is_weighed_and_not_limited():
    """Curb weight 11 842 kg; 27 kN per front wheel is the calibration's own anchor [T table 11]."""
    results, findings = play(cycle(), FakeMachine(), 300)
    estimates = results[-1].estimates
    normal = estimates[:4]
    assert sum(normal) == pytest.approx(11842 * 9.81, rel=0.02)
    assert normal[0] == pytest.approx(27e3, rel=0.03)
    assert normal[0] == pytest.approx(normal[1], rel=1e-6)
    assert normal[2] == pytest.approx(normal[3], rel=1e-6)
    values = last_values(results)
    assert all(flags(values).values())
    assert values["EcuStatus"]["State"] == State.RUNNING
    assert values["Limits"]["Cause"] == 0
    assert values["Warnings"]["Level"] == 0
    assert values["RollOver"]["TimeToLiftOff"] == pytest.approx(NEVER)
    assert not [f for f in findings if isinstance(f, (ProtectionFailed, Implausible))]


DEVIATIONS = {
    "NormalForceFrontLeft": ("normal_1_sd", 1e-3),
    "NormalForceFrontRight": ("normal_2_sd", 1e-3),
    "NormalForceRearLeft": ("normal_3_sd", 1e-3),
    "NormalForceRearRight": ("normal_4_sd", 1e-3),
    "LoadTransferRatio": ("load_transfer_ratio_sd", 1.0),
    "PayloadMass": ("payload_sd", 1.0),
}


def deviations(results):
    """The standard deviations as sent last, in the DBC's unit; None where they are not available."""
    layout = loader_database().by_name["EstimateUncertainty"].by_signal
    sent = last_values(results)["EstimateUncertainty"]
    absent = {name: layout[name].not_available * layout[name].scale for name in DEVIATIONS}
    return {name: None if sent[name] == absent[name] else sent[name] for name in DEVIATIONS}


def test_a_standard_deviation_is_sent_beside_every_load_ratio_and_payload():
    """Within half a step of the signal."""
    results, _ = play(cycle(), FakeMachine(), 300)
    frame = next(k for k in range(299, 0, -1) if "EstimateUncertainty" in decoded(results[k].frames))
    estimates, layout = results[frame].estimates, loader_database().by_name["EstimateUncertainty"].by_signal
    for name, sent in deviations(results).items():
        of, unit = DEVIATIONS[name]
        assert sent == pytest.approx(getattr(estimates, of) * unit, abs=0.51 * layout[name].scale), name


def test_no_standard_deviation_is_sent_where_there_is_none():
    """Before the first estimate, of one that is not valid, and by the printed equations."""
    silent = cycle()
    assert set(deviations([silent.tick(k * PERIOD_NS) for k in range(20)]).values()) == {None}
    printed, _ = play(cycle(form="printed"), FakeMachine(), 100)
    assert set(deviations(printed).values()) == {None}
    # without pressures nothing is known of the payload, and so nothing of the loads
    ecu, machine = cycle(), FakeMachine()
    play(ecu, machine, 100)
    machine.silent.add("LiftPressure")
    deaf, _ = play(ecu, machine, 100)
    assert deviations(deaf)["PayloadMass"] is None


def test_the_newest_sample_is_echoed():
    machine = FakeMachine()
    results, _ = play(cycle(), machine, 30)
    assert [decoded(r.frames)["EcuStatus"]["EchoSequence"] for r in results] == list(range(30))


def test_frames_keep_their_cycle_times_and_their_protection():
    results, _ = play(cycle(), FakeMachine(), 40)
    database = loader_database()
    for codec in database.by_name.values():
        if "EstimatorEcu" not in codec.senders:
            continue
        sent = [(k, f) for k, r in enumerate(results) for f in r.frames if f.can_id == codec.can_id]
        every = codec.cycle_ns // PERIOD_NS
        assert {b - a for (a, _), (b, _) in itertools.pairwise(sent)} <= {every}, codec.name
        assert len(sent) == 40 // every, codec.name
        if codec.e2e_data_id is not None:
            checker = Checker(codec)
            found = {checker.check(f.data, k * PERIOD_NS) for k, f in sent}
            assert found <= {Finding.OK, Finding.INITIAL}, codec.name


def test_equal_input_gives_equal_bytes():
    first, _ = play(cycle(), FakeMachine(articulation_angle=0.3, yaw_rate=0.1), 60)
    second, _ = play(cycle(), FakeMachine(articulation_angle=0.3, yaw_rate=0.1), 60)
    assert [r.frames for r in first] == [r.frames for r in second]


# Which conditions of the validity table a silent message takes away; motion and speed have a second source.
LOST = {
    "Articulation": {"articulation"},
    "WheelSpeedsFront": {"wheel_1", "wheel_2"},
    "WheelSpeedsRear": {"wheel_3", "wheel_4"},
    "WheelTorquesFront": {"torque"},
    "WheelTorquesRear": {"torque"},
    "BodyAcceleration": set(),
    "BodyRates": set(),
    "SlopeSensor": set(),
    "LiftPressure": {"mass"},
    "TiltPressure": {"mass"},
    "LinkageAngles": {"mass"},
    "DriverDemand": set(),
}


WATCHED_ONLY = "SteeringPressures"
"""Faults of it are reported, and no estimate needs it."""
UNUSED = ("VehicleSpeed", WATCHED_ONLY)


@pytest.mark.parametrize("message", [name for name in MESSAGES if name not in UNUSED])
def test_a_silent_message_invalidates_what_depends_on_it_and_nothing_else(message):
    ecu, machine = cycle(), FakeMachine()
    play(ecu, machine, 30)
    machine.silent = {message}
    results, findings = play(ecu, machine, 20)
    expected = {name: not LOST[message].intersection(needs) for name, needs in NEEDS.items()}
    assert flags(last_values(results)) == expected
    assert [type(f) for f in findings].count(Stale) == 1
    cause = last_values(results)["Limits"]["Cause"]
    assert (cause == 3) == (not expected["roll_over"])
    machine.silent = set()
    results, _ = play(ecu, machine, 20)
    assert all(flags(last_values(results)).values())
    assert ecu.state is State.RUNNING


@pytest.mark.parametrize("message", UNUSED)
@pytest.mark.parametrize("spoiled", ["silent", "cut short", "at its highest"])
def test_a_message_it_does_not_use_changes_nothing(message, spoiled):
    can_id = loader_database().by_name[message].can_id
    changes = {"silent": None, "cut short": b"", "at its highest": b"\xff" * 8}

    def spoil(frame):
        data = changes[spoiled]
        if frame.can_id != can_id:
            return frame
        return None if data is None else frame._replace(data=data)

    whole, expected = play(cycle(), FakeMachine(), 60)
    results, findings = play(cycle(), FakeMachine(), 60, spoil)
    if message != WATCHED_ONLY:
        assert findings == expected
        assert [r.frames for r in results] == [r.frames for r in whole]
    assert [r.estimates for r in results] == [r.estimates for r in whole]


def test_without_the_inertial_sensor_the_loads_come_from_wheels_and_slope():
    """A standing machine: the two ways agree."""
    ecu, machine = cycle(), FakeMachine()
    before = play(ecu, machine, 100)[0][-1].estimates
    machine.silent = {"BodyAcceleration", "BodyRates"}
    after = play(ecu, machine, 100)[0][-1].estimates
    for one, other in zip(before[:4], after[:4], strict=True):
        assert other == pytest.approx(one, rel=0.01)


def corrupted(frame, name, change):
    codec = loader_database().by_name[name]
    if frame.can_id != codec.can_id:
        return frame
    data = bytearray(frame.data)
    change(data)
    return frame._replace(data=bytes(data))


def flip_payload(data):
    data[3] ^= 0x40


def test_a_wrong_crc_is_found_and_its_value_not_used():
    ecu, machine = cycle(), FakeMachine()
    play(ecu, machine, 30)
    _, findings = play(ecu, machine, 1, spoil=lambda f: corrupted(f, "BodyAcceleration", flip_payload))
    assert [(f.message, f.what) for f in findings] == [("BodyAcceleration", Finding.WRONG_CRC)]
    results, _ = play(ecu, machine, 1)
    assert decoded(results[-1].frames)["EcuStatus"]["State"] == State.RUNNING  # one frame is no staleness
    values = last_values(play(ecu, machine, 2)[0])
    assert values["Warnings"]["ProtectionError"] == 1


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"wheel_speed_3": 29.0}, "outside"),
        ({"articulation_angle": 0.2}, "in one frame"),
        ({"health": 2.0}, "fault"),
        ({"roll": 0.5}, "in one frame"),
    ],
)
def test_an_implausible_value_is_reported_once_and_not_used(change, word):
    ecu, machine = cycle(), FakeMachine()
    good = play(ecu, machine, 50)[0][-1].estimates
    machine.values |= change
    if "health" in change:
        results, findings = play(ecu, machine, 5)
    else:
        results, findings = play(ecu, machine, 1)
    doubts = [f for f in findings if isinstance(f, Implausible)]
    assert doubts
    assert all(word in f.reason for f in doubts)
    assert len({(f.message, f.signal) for f in doubts}) == len(doubts)
    assert results[-1].estimates.normal_1 == pytest.approx(good.normal_1, rel=1e-3)


def test_a_value_that_is_not_available_is_not_used():
    ecu, machine = cycle(), FakeMachine()
    play(ecu, machine, 30)
    machine.values["lift_pressure"] = float("nan")
    results, findings = play(ecu, machine, 6)
    assert [f.reason for f in findings if isinstance(f, Implausible)] == ["not available"]
    assert not flags(last_values(results))["payload"]


def test_a_step_is_believed_when_it_stays():
    """A sensor that was exchanged: one frame is lost, the next is taken."""
    ecu, machine = cycle(), FakeMachine()
    play(ecu, machine, 30)
    machine.values["articulation_angle"] = 0.2
    play(ecu, machine, 2)
    _, findings = play(ecu, machine, 5)
    assert not [f for f in findings if isinstance(f, Implausible)]
    assert ecu.state is State.RUNNING


def test_states_as_they_are_entered_and_left():
    ecu, machine = cycle(), FakeMachine()
    changes = []

    def note(findings):
        changes.extend((f.before.name, f.after.name) for f in findings if isinstance(f, StateChanged))

    note(play(ecu, machine, 30)[1])
    machine.silent = {"SlopeSensor"}
    note(play(ecu, machine, 10)[1])
    machine.silent = set()
    note(play(ecu, machine, 10)[1])
    assert changes == [("INIT", "RUNNING"), ("RUNNING", "DEGRADED"), ("DEGRADED", "RUNNING")]


def test_an_estimate_that_is_no_number_is_a_fault():
    broken = dataclasses.replace(
        CALIBRATION,
        parameters=CALIBRATION.parameters._replace(
            rear=CALIBRATION.parameters.rear._replace(mass=float("nan"))
        ),
    )
    ecu, machine = EcuCycle(broken), FakeMachine()
    results, findings = play(ecu, machine, 20)
    assert ecu.state is State.FAULT
    values = last_values(results)
    assert values["Limits"]["Cause"] == 3
    assert not any(flags(values).values())
    assert [f.error for f in findings if isinstance(f, EstimatorFailed)] == ["an estimate is not a number"]


def failing_once(ecu, at):
    """Let the estimators raise in one cycle, as compiled code does when it divides by zero."""
    estimate, count = ecu._estimator.estimate, itertools.count()

    def fails(inputs):
        if next(count) == at:
            raise ZeroDivisionError("division by zero")
        return estimate(inputs)

    ecu._estimator.estimate = fails


def test_estimators_that_fail_are_a_fault_which_good_inputs_end():
    ecu, machine = cycle(), FakeMachine()
    failing_once(ecu, 20)
    results, findings = play(ecu, machine, 60)
    assert [f.error for f in findings if isinstance(f, EstimatorFailed)] == ["division by zero"]
    assert ecu.state is State.FAULT
    assert last_values(results)["Limits"]["Cause"] == 3
    results, _ = play(ecu, machine, 100)
    assert ecu.state is State.RUNNING
    assert all(flags(last_values(results[-20:])).values())


def test_a_fault_lasts_while_an_input_is_bad():
    ecu, machine = cycle(), FakeMachine()
    failing_once(ecu, 20)
    play(ecu, machine, 50)
    machine.silent = {"SlopeSensor"}
    play(ecu, machine, 200)
    assert ecu.state is State.FAULT


def test_after_a_fault_the_limits_rise_slowly():
    ecu, machine = cycle(), FakeMachine()
    failing_once(ecu, 20)
    results, _ = play(ecu, machine, 160)
    speeds = [v["Limits"]["Speed"] for result in results if "Limits" in (v := decoded(result.frames))]
    rise = max(b - a for a, b in itertools.pairwise(speeds[15:]))
    assert 0.0 < rise < 2.0


def test_a_machine_without_weight_is_a_sensor_without_supply():
    ecu, machine = cycle(), FakeMachine()
    play(ecu, machine, 50)
    machine.values |= {"specific_force_z": 0.0}
    results, findings = play(ecu, machine, 50)
    assert {f.reason for f in findings if isinstance(f, Implausible)} == {WEIGHTLESS}
    assert ecu.state is State.DEGRADED
    assert last_values(results)["NormalForces"]["FrontLeftValid"] == 1  # wheels and slope stand in


def test_limits_that_are_off_are_the_machines_own():
    ecu = cycle(limits_enabled=False)
    machine = FakeMachine(articulation_angle=0.6, **{f"wheel_speed_{n}": 9.0 for n in (1, 2, 3, 4)})
    values = last_values(play(ecu, machine, 60)[0])
    assert values["Limits"]["Cause"] == 0
    assert values["Limits"]["Speed"] == pytest.approx(51.0)
    assert values["Limits"]["ArticulationRate"] == pytest.approx(51.0)


def test_overruns_are_counted_and_execution_time_is_sent():
    ecu, machine = cycle(), FakeMachine()
    play(ecu, machine, 20)
    ecu.executed(246_000)
    ecu.overran(3)
    values = last_values(play(ecu, machine, 2)[0])
    assert values["EcuStatus"]["Overruns"] == 3
    assert values["EcuStatus"]["ExecutionTime"] == 246
    assert values["Warnings"]["CycleOverrun"] == 1


def test_frames_of_others_are_not_looked_at():
    assert cycle().receive(Frame(0x123, b"\x00"), 0) == []
