"""The table of states: every state and event is defined, nothing is a dead end, a fault stays until the inputs have recovered."""

import pytest

from dbc import loader_database
from ecu.limits import Cause
from ecu.reasons import Level, RollOver
from ecu.states import TRANSITIONS, Event, State, after, diagram

EVERYTHING = [(state, event) for state in State for event in Event]


@pytest.mark.parametrize(("state", "event"), EVERYTHING)
def test_every_state_answers_every_event(state, event):
    assert isinstance(after(state, event), State)


def test_the_table_holds_nothing_else():
    assert set(TRANSITIONS) == set(State)
    assert all(set(row) == set(Event) for row in TRANSITIONS.values())


def reachable(start):
    """Every state that some sequence of events leads to."""
    found, edge = {start}, {start}
    while edge:
        edge = {after(state, event) for state in edge for event in Event} - found
        found |= edge
    return found


@pytest.mark.parametrize("state", State)
def test_no_state_is_a_dead_end(state):
    assert reachable(state) == set(State)


@pytest.mark.parametrize("event", Event)
def test_only_recovery_leads_out_of_a_fault(event):
    assert after(State.FAULT, event) is (State.INIT if event is Event.RECOVERED else State.FAULT)


@pytest.mark.parametrize("state", State)
def test_an_internal_error_is_a_fault_wherever_it_happens(state):
    assert after(state, Event.INTERNAL_ERROR) is State.FAULT


@pytest.mark.parametrize("state", [State.INIT, State.RUNNING, State.DEGRADED])
def test_good_inputs_run_and_bad_ones_never_do(state):
    assert after(state, Event.INPUTS_GOOD) is State.RUNNING
    assert after(state, Event.INPUTS_BAD) is not State.RUNNING


@pytest.mark.parametrize(("state", "event"), EVERYTHING)
def test_an_event_that_repeats_itself_moves_once(state, event):
    once = after(state, event)
    assert after(once, event) is once


def test_the_diagram_shows_every_move_and_no_other():
    lines = {line.strip() for line in diagram().splitlines()}
    moves = [(s, e) for s, e in EVERYTHING if after(s, e) is not s]
    for state, event in moves:
        assert f"{state.name.lower()} --> {after(state, event).name.lower()}: {event.value}" in lines
    assert len(lines) == len(moves) + 2


@pytest.mark.parametrize(
    ("message", "signal", "kind"),
    [
        ("EcuStatus", "State", State),
        ("RollOver", "State", RollOver),
        ("Warnings", "Level", Level),
        ("Limits", "Cause", Cause),
    ],
)
def test_values_are_those_of_the_dbc(message, signal, kind):
    choices = loader_database().by_name[message].by_signal[signal].choices
    known = {value: name for value, name in choices.items() if name != "not_available"}
    assert known == {k.value: k.name.lower() for k in kind if k.name != "NOT_AVAILABLE"}
