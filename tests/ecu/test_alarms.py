"""Alarms neither flicker nor come late, whatever the condition does."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from ecu.alarms import SILENT, Times, advanced, after, below
from ecu.calibration import load_calibration
from ecu.reasons import REASONS, STATES, times

MS = 1_000_000
TICK = 10 * MS

delays = st.integers(0, 12).map(lambda ticks: ticks * TICK)
all_times = st.builds(Times, on_delay_ns=delays, least_on_ns=delays, off_delay_ns=delays)
# intervals rather than single ticks, so that the delays are sometimes passed
histories = st.lists(st.tuples(st.booleans(), st.integers(1, 20)), min_size=1, max_size=12).map(
    lambda intervals: [value for value, length in intervals for _ in range(length)]
)


def played(conditions, timing):
    """Whether the alarm is on at each tick."""
    alarm, states = SILENT, []
    for k, condition in enumerate(conditions):
        alarm = after(alarm, condition, k * TICK, timing)
        states.append(alarm.on)
    return states


def intervals(states):
    """(value, first tick, ticks) of each unbroken stretch."""
    first = 0
    for value, group in itertools.groupby(states):
        length = len(list(group))
        yield value, first, length
        first += length


def held(conditions, value, k):
    """For how long [ns] the condition has been `value` without a break at tick k; -1 if it is not."""
    length = 0
    while k - length >= 0 and conditions[k - length] == value:
        length += 1
    return (length - 1) * TICK


@given(histories, all_times)
def test_an_alarm_stands_for_its_least_time(conditions, timing):
    states = played(conditions, timing)
    for value, first, length in intervals(states):
        if value and first + length < len(states):
            assert length * TICK >= timing.least_on_ns


@given(histories, all_times)
def test_it_is_raised_as_soon_as_the_condition_has_held_for_the_on_delay_and_not_before(conditions, timing):
    states = played(conditions, timing)
    for k, on in enumerate(states):
        before = states[k - 1] if k else False
        if held(conditions, True, k) >= timing.on_delay_ns:
            assert on
        elif not before:
            assert not on


@given(histories, all_times)
def test_it_is_dropped_as_soon_as_both_times_are_over_and_not_before(conditions, timing):
    states = played(conditions, timing)
    raised = 0
    for k in range(1, len(states)):
        if states[k] and not states[k - 1]:
            raised = k
        if not states[k - 1]:
            continue
        over = (k - raised) * TICK >= timing.least_on_ns
        gone = held(conditions, False, k) >= timing.off_delay_ns and not conditions[k]
        assert states[k] == (not (over and gone))


@given(histories, all_times, st.data())
def test_a_repeated_tick_changes_nothing(conditions, timing, data):
    once = twice = SILENT
    for k, condition in enumerate(conditions):
        once = after(once, condition, k * TICK, timing)
        for _ in range(data.draw(st.integers(1, 3))):
            twice = after(twice, condition, k * TICK, timing)
        assert once == twice


def test_names_do_not_touch_one_another():
    slow = Times(on_delay_ns=5 * TICK, least_on_ns=0, off_delay_ns=0)
    fast = Times(on_delay_ns=0, least_on_ns=0, off_delay_ns=0)
    alarms = advanced({}, {"a": True, "b": True, "c": False}, 0, {"a": slow, "b": fast, "c": fast})
    assert {name: alarm.on for name, alarm in alarms.items()} == {"a": False, "b": True, "c": False}


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 0.5))
def test_hysteresis_raises_the_threshold_of_an_alarm_that_is_on_and_of_no_other(value, threshold, width):
    assert below(value, threshold, width, on=False) == (value < threshold)
    assert below(value, threshold, width, on=True) == (value < threshold + width)


def test_every_reason_and_state_has_its_delays_and_roll_over_is_told_within_30_ms():
    known = times(load_calibration().alarms)
    assert set(REASONS) <= set(known)
    for state in STATES:
        assert known[state.name].on_delay_ns + TICK <= 30 * MS
    for reason in ("RollOverPredicted", "RollOverNow", "WheelLifted"):
        assert known[reason].on_delay_ns + TICK <= 30 * MS
