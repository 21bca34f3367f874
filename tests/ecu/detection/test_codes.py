"""Trouble codes: active while the fault lasts, previous afterwards, counted once per occurrence, all on the bus in turn."""

import pytest

from dbc import loader_database
from ecu.bus_signals import Received, rows
from ecu.calibration import load_calibration
from ecu.codes import HOLD_NS, MOST_OCCURRENCES, FreezeFrame, Mode, TroubleCodes
from ecu.cycle import EcuCycle
from ecu.estimators.signals import Inputs
from ecu.inputs import GROUP_OF
from tests.ecu.machine import PERIOD_NS, FakeMachine, decoded, play

FRAME = FreezeFrame(0.5, 1.0, 0.1, 0.2, 3.0)
NUMBER = {
    name: value for value, name in loader_database().by_name["ActiveFaults"].by_signal["Spn"].choices.items()
}
OFFSET = 458752


def codes():
    return TroubleCodes(loader_database())


def test_every_input_and_message_has_an_spn():
    for name, _ in rows(Inputs, Received):
        assert name in NUMBER
    assert {f"message_{name}" for name in GROUP_OF} <= set(NUMBER)


def test_a_code_is_active_until_its_hold_time_is_over():
    found = codes()
    assert found.occurred("pitch", Mode.ERRATIC, 0, FRAME)
    found.continued((), HOLD_NS)
    assert [code.name for code in found.active] == ["pitch"]
    found.continued((), HOLD_NS + 1)
    assert not found.active
    assert [code.name for code in found.previous] == ["pitch"]


def test_a_fault_that_goes_on_is_one_occurrence():
    found = codes()
    found.occurred("pitch", Mode.ERRATIC, 0, FRAME)
    for now in range(0, 10 * HOLD_NS, HOLD_NS // 2):
        found.continued({"pitch"}, now)
    assert not found.occurred("pitch", Mode.ERRATIC, 10 * HOLD_NS, FRAME)
    assert found.active[0].occurrences == 1


def test_occurrences_saturate():
    found = codes()
    for k in range(200):
        found.occurred("pitch", Mode.ERRATIC, 3 * k * HOLD_NS, FRAME)
        found.continued((), (3 * k + 2) * HOLD_NS)
    assert found.previous[0].occurrences == MOST_OCCURRENCES


def test_the_freeze_frame_is_that_of_the_first_moment():
    found = codes()
    found.occurred("pitch", Mode.ERRATIC, 0, FRAME)
    found.occurred("pitch", Mode.ERRATIC, 5, FRAME._replace(speed=9.0))
    assert found.active[0].frozen == FRAME


def test_the_bus_shows_every_code_in_turn():
    found = codes()
    for name in ("pitch", "roll", "yaw_rate"):
        found.occurred(name, Mode.ERRATIC, 0, FRAME)
    shown = [found.values(10 * k, invalid=True, stopped=False)["ActiveFaults Spn"] for k in range(6)]
    assert [s - OFFSET for s in shown] == [NUMBER[n] for n in ("pitch", "roll", "yaw_rate")] * 2


@pytest.mark.parametrize(
    ("signal", "value", "mode"),
    [("wheel_speed_1", 30.0, Mode.ABOVE_RANGE), ("wheel_speed_1", -30.0, Mode.BELOW_RANGE)],
)
def test_a_signal_out_of_range_is_a_code_on_the_bus(signal, value, mode):
    ecu, machine = EcuCycle(load_calibration(), detect_faults=True), FakeMachine()
    play(ecu, machine, 30)
    machine.values[signal] = value
    results, _ = play(ecu, machine, 30)
    sent = [decoded(r.frames) for r in results]
    active = [s["ActiveFaults"] for s in sent if "ActiveFaults" in s][-1]
    frozen = [s["FaultFreezeFrame"] for s in sent if "FaultFreezeFrame" in s][-1]
    assert active["Spn"] - OFFSET == NUMBER[signal]
    assert (active["SpnTop"], active["OccurrenceCount"], active["Codes"], active["ProtectLamp"]) == (
        7,
        1,
        1,
        1,
    )
    assert active["Fmi"] == mode
    assert frozen["Spn"] == active["Spn"]
    assert frozen["At"] == 0
    machine.values[signal] = 0.0
    results, _ = play(ecu, machine, 130)
    newest = {}
    for r in results:
        newest |= decoded(r.frames)
    assert newest["ActiveFaults"]["Codes"] == 0
    assert newest["PreviousFaults"]["Spn"] - OFFSET == NUMBER[signal]


def test_a_message_that_falls_silent_is_a_code():
    ecu, machine = EcuCycle(load_calibration(), detect_faults=True), FakeMachine()
    play(ecu, machine, 30)
    machine.silent.add("BodyRates")
    results, _ = play(ecu, machine, 30)
    active = [v["ActiveFaults"] for r in results if "ActiveFaults" in (v := decoded(r.frames))][-1]
    assert active["Spn"] - OFFSET == NUMBER["message_BodyRates"]
    assert active["Fmi"] == Mode.UPDATE_RATE


def test_estimators_that_fail_leave_a_code():
    ecu, machine = EcuCycle(load_calibration(), detect_faults=True), FakeMachine()
    play(ecu, machine, 30)

    def broken(inputs):
        raise ZeroDivisionError("float division by zero")

    ecu._estimator.estimate = broken
    results, _ = play(ecu, machine, 30)
    active = [v["ActiveFaults"] for r in results if "ActiveFaults" in (v := decoded(r.frames))][-1]
    assert active["Spn"] - OFFSET == NUMBER["estimators"]
    assert (active["Fmi"], active["RedStopLamp"]) == (Mode.BAD_DEVICE, 1)


def test_a_sound_machine_leaves_no_code():
    ecu, machine = EcuCycle(load_calibration(), detect_faults=True), FakeMachine()
    results, _ = play(ecu, machine, 50)
    assert PERIOD_NS == 10_000_000
    shown = [v["ActiveFaults"] for r in results if "ActiveFaults" in (v := decoded(r.frames))]
    assert shown
    assert all(v["Codes"] == 0 and v["Spn"] == OFFSET for v in shown)
