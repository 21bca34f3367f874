"""The estimators' page shows the tables the code runs by."""

from pathlib import Path

from ecu.states import TRANSITIONS, Event, State, diagram
from ecu.validity import NEEDS

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "explanation" / "estimators.md").read_text(
    encoding="utf-8"
)


def test_validity_table_and_state_diagram_are_current():
    for name, needs in NEEDS.items():
        assert f"| {name} | {', '.join(needs)} |" in PAGE
    assert diagram() in PAGE


def test_every_state_answers_every_event_and_a_fault_ends_by_recovery_only():
    assert set(TRANSITIONS) == set(State)
    assert all(set(row) == set(Event) for row in TRANSITIONS.values())
    assert [e for e, target in TRANSITIONS[State.FAULT].items() if target is not State.FAULT] == [
        Event.RECOVERED
    ]
