"""States of the ECU's cycle and what moves it between them: one table, and the diagram drawn from it."""

import enum
from collections.abc import Mapping
from typing import Final


class State(enum.IntEnum):
    """Values are those of EcuStatus.State in the DBC."""

    INIT = 0
    RUNNING = 1
    DEGRADED = 2
    FAULT = 3


class Event(enum.Enum):
    """What can happen between two cycles."""

    INPUTS_GOOD = "every input is fresh and plausible"
    INPUTS_BAD = "an input is stale or implausible"
    START_UP_OVER = "the time to wait for the first inputs is over"
    INTERNAL_ERROR = "an estimate is not a number"
    RECOVERED = "after a fault, every input has been good for the time to recover"


TRANSITIONS: Final[Mapping[State, Mapping[Event, State]]] = {
    State.INIT: {
        Event.INPUTS_GOOD: State.RUNNING,
        Event.INPUTS_BAD: State.INIT,
        Event.START_UP_OVER: State.DEGRADED,
        Event.INTERNAL_ERROR: State.FAULT,
        Event.RECOVERED: State.INIT,
    },
    State.RUNNING: {
        Event.INPUTS_GOOD: State.RUNNING,
        Event.INPUTS_BAD: State.DEGRADED,
        Event.START_UP_OVER: State.RUNNING,
        Event.INTERNAL_ERROR: State.FAULT,
        Event.RECOVERED: State.RUNNING,
    },
    State.DEGRADED: {
        Event.INPUTS_GOOD: State.RUNNING,
        Event.INPUTS_BAD: State.DEGRADED,
        Event.START_UP_OVER: State.DEGRADED,
        Event.INTERNAL_ERROR: State.FAULT,
        Event.RECOVERED: State.DEGRADED,
    },
    State.FAULT: {
        Event.INPUTS_GOOD: State.FAULT,
        Event.INPUTS_BAD: State.FAULT,
        Event.START_UP_OVER: State.FAULT,
        Event.INTERNAL_ERROR: State.FAULT,
        Event.RECOVERED: State.INIT,
    },
}


def after(state: State, event: Event) -> State:
    """The state that follows."""
    return TRANSITIONS[state][event]


def diagram() -> str:
    """The table as a Mermaid state diagram; transitions that stay are left out."""
    lines = ["stateDiagram-v2", "    [*] --> init"]
    for state, row in TRANSITIONS.items():
        lines += [
            f"    {state.name.lower()} --> {target.name.lower()}: {event.value}"
            for event, target in row.items()
            if target is not state
        ]
    return "\n".join(lines) + "\n"
