"""The law of limits that the fuzz cases are judged by can fail."""

import pytest

from bus.frame import Frame
from ecu.core import PYTHON
from ecu.states import State
from tests.ecu.machine import FakeMachine
from tests.fuzz.both import CALIBRATION, bounds, check_limits


@pytest.fixture(scope="module")
def running():
    """The frames of an ECU that permits all that the machine can do."""
    ecu, machine = PYTHON.ecu(CALIBRATION), FakeMachine()
    for _ in range(30):
        for frame in machine.frames():
            ecu.receive(frame, machine.now_ns)
        frames = ecu.tick(machine.now_ns).frames
    assert ecu.state is State.RUNNING
    return frames


def test_the_machines_own_limits_are_permitted_while_it_runs(running):
    check_limits(running, State.RUNNING)


@pytest.mark.parametrize("state", [State.INIT, State.FAULT])
def test_they_are_not_where_the_margin_is_unknown(running, state):
    with pytest.raises(AssertionError, match=f"in {state}"):
        check_limits(running, state)


def test_a_limit_that_is_not_available_is_found():
    for can_id, (binding, _, _) in bounds().items():
        with pytest.raises(AssertionError, match=binding.signals[0]):
            check_limits([Frame(can_id, b"\xff" * binding.codec.length)], State.RUNNING)
