"""Each reason holds when its condition does and only then; the roll-over state is the gravest that stands."""

import dataclasses
import math

import numpy as np
import pytest

from dbc import loader_database
from ecu.alarms import SILENT, Alarm
from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle
from ecu.estimators.signals import NEVER, Estimates
from ecu.inputs import CycleInputs, Group, InputReceiver
from ecu.reasons import (
    REASONS,
    STATES,
    Level,
    RollOver,
    conditions,
    level,
    roll_over_conditions,
    roll_over_state,
)
from ecu.validity import NEEDS
from tests.ecu.machine import FakeMachine, decoded, play

CALIBRATION = load_calibration()
RULES = CALIBRATION.warnings
STOP = CALIBRATION.parameters.geometry.articulation_stop
CALM = Estimates(*([0.0] * len(Estimates._fields)))._replace(
    normal_1=27e3, normal_2=27e3, normal_3=31e3, normal_4=31e3,
    lift_off_margin=1.0, predicted_margin=1.0, time_to_lift_off=NEVER, speed=5.0,
)  # fmt: skip
ALL = dict.fromkeys(NEEDS, True)
QUIET = InputReceiver(CALIBRATION, loader_database()).gather(0)


def received(unusable=(), stale=(), implausible=(), **values):
    return CycleInputs(
        {**QUIET.values, **values}, frozenset(unusable), frozenset(stale), frozenset(implausible)
    )


def found(e=CALM, inputs=None, valid=ALL):
    return {name for name, on in conditions(e, inputs or received(), valid, STOP, RULES).items() if on}


def test_a_calm_machine_gives_no_reason():
    assert found() == set()


@pytest.mark.parametrize(
    ("reason", "change", "needs"),
    [
        ("RollOverPredicted", {"time_to_lift_off": 1.0}, "roll_over"),
        ("RollOverNow", {"lift_off_margin": 0.05}, "roll_over"),
        ("WheelLifted", {"normal_3": -1.0}, "normal"),
        ("WheelSpin", {"slip_2": 0.5}, "slip_2"),
        ("WheelLock", {"slip_4": -0.9}, "slip_4"),
        ("AxleOverload", {"normal_1": 90e3, "normal_2": 90e3}, "normal"),
    ],
)
def test_an_estimate_gives_its_reason_while_it_is_valid(reason, change, needs):
    e = CALM._replace(**change)
    assert found(e) == {reason}
    assert found(e, valid=ALL | {needs: False}) == {"EstimateInvalid"}


@pytest.mark.parametrize(
    ("reason", "signal", "value"),
    [
        ("ArticulationNearStop", "articulation_angle", STOP - math.radians(1)),
        ("ArticulationNearStop", "articulation_angle", -STOP + math.radians(1)),
    ],
)
def test_an_input_gives_its_reason_while_it_is_usable(reason, signal, value):
    assert found(inputs=received(**{signal: value})) == {reason}
    assert found(inputs=received(unusable=[signal], **{signal: value})) == set()


@pytest.mark.parametrize(("signal", "degrees"), [("pitch", -16.0), ("roll", 16.0)])
def test_a_steep_slope_is_a_reason_while_its_sensor_is_usable(signal, degrees):
    steep = CALM._replace(**{f"slope_{signal}": math.radians(degrees)})
    assert found(steep) == {"SteepSlope"}
    assert found(steep, received(unusable=[signal])) == set()
    # what accelerations add to the reading is no slope
    assert found(CALM, received(**{signal: math.radians(degrees)})) == set()


def test_a_raised_load_matters_only_at_speed():
    e, raised = CALM._replace(payload=3000.0), received(lift_arm_angle=0.5)
    assert found(e, raised) == {"PayloadHigh"}
    assert found(e._replace(speed=1.0), raised) == set()
    assert found(e, received(lift_arm_angle=-0.5)) == set()


def test_a_standing_wheel_is_not_locked():
    assert found(CALM._replace(speed=0.0, slip_1=-1.0)) == set()


def test_troubles_with_inputs_are_sent_as_reasons():
    assert found(inputs=received(stale=[Group.SLOPE])) == {"InputStale"}
    assert found(inputs=received(implausible=[Group.SLOPE])) == {"InputImplausible"}
    assert found(valid=ALL | {"payload": False}) == {"EstimateInvalid"}


def test_the_level_is_that_of_the_loudest_reason():
    assert level(dict.fromkeys(REASONS, False)) is Level.NONE
    assert level({"WheelSpin": True, "PayloadHigh": True, "WheelLifted": False}) is Level.CAUTION


ON, OFF = Alarm(True), SILENT


@pytest.mark.parametrize("on", [True, False])
@pytest.mark.parametrize("time", [0.1, 1.0, NEVER])
@pytest.mark.parametrize("margin", [-0.1, 0.05, 0.2, 0.4, 0.9])
def test_a_graver_state_includes_the_lesser(margin, time, on):
    """Whatever the margins, if a state holds then every lesser one does."""
    e = CALM._replace(lift_off_margin=margin, predicted_margin=margin, time_to_lift_off=time)
    alarms = {state.name: ON if on else OFF for state in STATES}
    holds = [roll_over_conditions(e, True, alarms, RULES)[state.name] for state in STATES]
    assert holds == sorted(holds, reverse=True)
    assert not any(roll_over_conditions(e, False, alarms, RULES).values())


def test_the_state_is_the_gravest_that_is_on():
    alarms = {state.name: OFF for state in STATES}
    assert roll_over_state(alarms, True) is RollOver.STABLE
    for state in STATES:
        alarms[state.name] = ON
        assert roll_over_state(alarms, True) is state
    assert roll_over_state(alarms, False) is RollOver.NOT_AVAILABLE


def sent(results, message, signal):
    """The signal in every frame of the message."""
    frames = [decoded(result.frames) for result in results]
    return [values[message][signal] for values in frames if message in values]


def test_a_margin_that_dances_on_the_threshold_does_not_make_the_warning_flicker():
    """The threshold is moved instead of the machine: to the margin that the machine has, give or take."""
    # a bank, as the inclination sensor has it too
    leaning = {"specific_force_y": 4.0, "specific_force_z": 9.0, "roll": math.atan2(4.0, 9.0)}
    ecu, machine, seen = EcuCycle(CALIBRATION, limits_enabled=False), FakeMachine(**leaning), []
    for k in range(300):
        machine.values["specific_force_y"] = 4.0 + 1.5 * (-1) ** (k // 3)
        seen += play(ecu, machine, 1)[0]
    margin = float(np.median([e.estimates.lift_off_margin for e in seen[50:]]))
    rules = dataclasses.replace(RULES, warning_margin=margin, imminent_margin=-1.0, attention_margin=1.0)
    ecu = EcuCycle(dataclasses.replace(CALIBRATION, warnings=rules), limits_enabled=False)
    machine, results = FakeMachine(**leaning), []
    for k in range(300):
        machine.values["specific_force_y"] = 4.0 + 1.5 * (-1) ** (k // 3)
        results += play(ecu, machine, 1)[0]
    states = sent(results[50:], "RollOver", "State")
    assert min(e.estimates.lift_off_margin for e in results[50:]) < margin
    assert max(e.estimates.lift_off_margin for e in results[50:]) > margin + RULES.margin_hysteresis
    assert len(set(states[10:])) == 1


def test_a_lifted_wheel_is_told_within_30_ms_of_the_estimate():
    ecu, machine = EcuCycle(CALIBRATION), FakeMachine()
    play(ecu, machine, 50)
    machine.values |= {"specific_force_y": 12.0, "specific_force_z": 9.0}
    results = play(ecu, machine, 100)[0]
    lifted = next(k for k, r in enumerate(results) if r.estimates.lift_off_margin <= 0.0)
    shown = next(
        k for k, r in enumerate(results) if decoded(r.frames)["RollOver"]["State"] == RollOver.LIFTED
    )
    assert 0 <= shown - lifted <= 2
