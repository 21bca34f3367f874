"""Each kind of expectation on samples whose answer is plain; what cannot be judged is never passed."""

import math

import numpy as np
import pytest

from dbc import loader_database
from hil.verdict import Result
from testbench.expect.condition import Condition
from testbench.expect.expectations import (
    InBounds,
    InStates,
    NoLiftOff,
    NoRollOver,
    Reached,
    Reaction,
    Response,
    Window,
)
from testbench.expect.obedience import LimitsObeyed
from testbench.expect.signals import SignalError, find_signal
from tests.testbench.expect.evidence import columns, evidence, truth

DATABASE = loader_database()
STANDING = np.full((100, 4), 30_000.0)
NOTHING = evidence()


def condition(text):
    return Condition.parse(text, DATABASE)


def signal(name):
    return find_signal(name, DATABASE)


def speed(*values):
    return evidence(columns("BodyMotion", Speed=values))


def result(expectation, seen):
    return expectation.judge(seen).result


@pytest.mark.parametrize(
    "expectation",
    [
        NoLiftOff(),
        NoRollOver(),
        InBounds(signal("BodyMotion.Speed"), 0, 1),
        InBounds(signal("truth.speed"), 0, 1),
        InStates(signal("EcuStatus.State"), (1,)),
        Reached(condition("BodyMotion.Speed > 1"), Window()),
        Response(condition("BodyMotion.Speed > 1"), condition("Limits.Cause > 0"), 0.1),
        Reaction(0.02),
        LimitsObeyed(),
    ],
)
def test_nothing_recorded_is_inconclusive(expectation):
    assert result(expectation, NOTHING) is Result.INCONCLUSIVE


@pytest.mark.parametrize("window", [Window(5.0), Window(5.0, 6.0)])
def test_a_window_after_the_run_is_inconclusive(window):
    seen = evidence(
        columns("BodyMotion", Speed=[0.0] * 100), true=truth(normal_force=STANDING, roll=np.zeros(100))
    )
    for expectation in (
        NoLiftOff(window),
        NoRollOver(window),
        InBounds(signal("BodyMotion.Speed"), 0, 1, window),
    ):
        assert result(expectation, seen) is Result.INCONCLUSIVE


def test_lift_off_fails_and_names_wheel_and_time():
    lifted = STANDING.copy()
    lifted[50:, 1] = 0.0
    verdict = NoLiftOff().judge(evidence(true=truth(normal_force=lifted)))
    assert (verdict.result, verdict.reason) == (Result.FAILED, "front right lifts at 0.50 s")
    assert result(NoLiftOff(Window(0, 0.4)), evidence(true=truth(normal_force=lifted))) is Result.PASSED


def test_wheel_hop_is_no_lift_off():
    hop = STANDING.copy()
    hop[50:54, 1] = 0.0
    assert result(NoLiftOff(), evidence(true=truth(normal_force=hop))) is Result.PASSED


def test_roll_over_is_45_degrees_either_way():
    for most, expected in ((0.78, Result.PASSED), (0.79, Result.FAILED), (-0.79, Result.FAILED)):
        assert result(NoRollOver(), evidence(true=truth(roll=np.linspace(0, most, 100)))) is expected


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ((0, 1, 2), Result.PASSED),
        ((0, 2.001, 0), Result.FAILED),
        ((0, -0.001, 0), Result.FAILED),
        ((0, math.nan), Result.FAILED),
    ],
)
def test_a_signal_leaves_its_bounds_by_one_sample(values, expected):
    assert result(InBounds(signal("BodyMotion.Speed"), 0, 2), speed(*values)) is expected


def test_a_value_that_is_not_available_is_outside():
    absent = DATABASE.by_name["BodyMotion"].by_signal["Speed"].not_available * 0.005
    verdict = InBounds(signal("BodyMotion.Speed"), -math.inf, 50).judge(speed(0, absent, 0))
    assert verdict.result is Result.FAILED
    assert "not available" in verdict.reason


def test_short_excursions_can_be_passed_over():
    values = [0.0] * 10 + [9.0] * 3 + [0.0] * 10
    for ignore_s, expected in ((0.0, Result.FAILED), (0.029, Result.FAILED), (0.031, Result.PASSED)):
        assert (
            result(InBounds(signal("BodyMotion.Speed"), 0, 2, ignore_s=ignore_s), speed(*values)) is expected
        )


def test_bounds_hold_within_the_window_only():
    values = [9.0] * 50 + [1.0] * 50
    for window, expected in (
        (Window(), Result.FAILED),
        (Window(0.5), Result.PASSED),
        (Window(0, 0.3), Result.FAILED),
    ):
        assert result(InBounds(signal("BodyMotion.Speed"), 0, 2, window), speed(*values)) is expected


def test_states_by_their_share_of_frames():
    seen = evidence(columns("EcuStatus", State=[0] * 5 + [1] * 95))
    running = signal("EcuStatus.State")
    assert result(InStates(running, (1,)), seen) is Result.FAILED
    assert result(InStates(running, (0, 1)), seen) is Result.PASSED
    assert result(InStates(running, (1,), least_share=0.95), seen) is Result.PASSED
    assert result(InStates(running, (1,), Window(0.05)), seen) is Result.PASSED


def test_reached_needs_the_condition_to_last():
    seen = speed(*[0.0] * 10, *[2.0] * 3, *[0.0] * 10, *[2.0] * 6)
    reached = Reached(condition("BodyMotion.Speed > 1"), Window(), 0.05)
    assert reached.judge(seen).reason == "at 0.23 s"
    assert result(Reached(condition("BodyMotion.Speed > 1"), Window(0, 0.2), 0.05), seen) is Result.FAILED


def test_not_available_is_no_state_beyond_warning():
    seen = evidence(columns("RollOver", State=[7] * 50))
    assert result(Reached(condition("RollOver.State >= warning"), Window()), seen) is Result.FAILED
    assert result(Reached(condition("RollOver.State == not_available"), Window()), seen) is Result.PASSED


def test_a_response_is_timed_from_each_cause():
    cause = columns("DriverDemand", BrakeDemand=[0] * 10 + [50] * 10 + [0] * 10 + [50] * 70)
    effect = columns("Limits", Cause=[0] * 12 + [1] * 8 + [0] * 15 + [1] * 65)
    expectation = Response(condition("DriverDemand.BrakeDemand > 10 %"), condition("Limits.Cause > 0"), 0.05)
    verdict = expectation.judge(evidence(cause, effect))
    assert (verdict.result, verdict.reason) == (Result.PASSED, "2 times, after 50.0 ms at most")
    slower = Response(expectation.cause, expectation.effect, 0.03).judge(evidence(cause, effect))
    assert (slower.result, slower.reason) == (Result.FAILED, "after 50.0 ms at 0.30 s")
    silent = evidence(cause, columns("Limits", Cause=[0] * 100))
    assert "no answer" in expectation.judge(silent).reason


def test_a_reaction_is_from_sample_to_echo():
    sample = columns("Articulation", SampleSequence=range(100))
    echo = columns("EcuStatus", EchoSequence=[max(n - 2, 0) for n in range(100)])
    for within_s, expected in ((0.021, Result.PASSED), (0.019, Result.FAILED)):
        assert result(Reaction(within_s), evidence(sample, echo)) is expected


def test_a_limit_counts_once_the_machine_could_settle():
    limits = columns("Limits", Speed=[51.1] * 20 + [18.0] * 180, ArticulationRate=[51.1] * 200)
    fast = truth(speed=[10.0] * 60 + [5.0] * 140, articulation_rate=np.zeros(200))
    seen = evidence(limits, true=fast, duration_s=2.0)
    assert result(LimitsObeyed(settle_s=0.5, speed_tolerance=0.1), seen) is Result.PASSED
    verdict = LimitsObeyed(settle_s=0.1, speed_tolerance=0.1).judge(seen)
    assert (verdict.result, verdict.reason) == (Result.FAILED, "speed 18.0 km/h above the limit at 0.30 s")
    turning = evidence(limits, true=truth(speed=[0.0] * 200, articulation_rate=np.ones(200)))
    assert result(LimitsObeyed(), turning) is Result.PASSED  # 51.1 deg/s: no limit was sent


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("BodyMotion.Speed", "is no condition"),
        ("BodyMotin.Speed > 1", "did you mean 'BodyMotion'"),
        ("BodyMotion.Sped > 1", "did you mean 'Speed'"),
        ("BodyMotion.Speed > 1 km/h", "is in m/s, not in km/h"),
        ("RollOver.State > warming", "its values are stable"),
        ("truth.sped > 1", "did you mean 'speed'"),
        ("truth.normal_force > 1", "several numbers"),
        ("truth.speed.x > 1", "one number"),
        ("speed > 1", "write Message.Signal"),
        ("truth.speed > nan", "NaN cannot be compared"),
    ],
)
def test_a_wrong_condition_says_what_there_is(text, says):
    with pytest.raises(SignalError, match=says):
        condition(text)


def test_truth_is_named_by_wheel_and_axis():
    seen = evidence(true=truth(normal_force=np.arange(400).reshape(100, 4), velocity=np.zeros((100, 3))))
    assert signal("truth.normal_force.rear_left").series(seen).values[0] == 2.0
    assert signal("truth.velocity.z").name == "truth.velocity.z"
