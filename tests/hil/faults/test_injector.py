"""Faults begin, end and are commanded at their times; what was done is reported."""

from bus.frame import Frame
from hil.faults.injector import REMEMBERED
from hil.faults.passage import Action
from tests.hil.faults.traffic import MS, frames, injector, passed

SPEEDS = "WheelSpeedsFront"


def reported(one):
    return [(e.at_ns // MS, e.number, e.what) for e in one.events]


def test_a_fault_holds_from_its_first_nanosecond_to_before_its_last():
    one = injector({"kind": "drop", "message": SPEEDS, "at_s": 0.1, "for_s": 0.1})
    (frame,) = frames(SPEEDS, 1)
    seen = [
        bool(one.pass_frame("plant", frame, at)) for at in (100 * MS - 1, 100 * MS, 200 * MS - 1, 200 * MS)
    ]
    assert seen == [True, False, False, True]


def test_times_count_from_the_start():
    from hil.faults.injector import Injector
    from tests.hil.faults.traffic import DATABASE, fault

    one = Injector(DATABASE, [fault(kind="drop", at_s=1.0)])
    (frame,) = frames(SPEEDS, 1)
    assert one.pass_frame("plant", frame, 5000 * MS)  # not started: nothing happens yet
    one.start(7000 * MS)
    assert one.pass_frame("plant", frame, 7999 * MS)
    assert not one.pass_frame("plant", frame, 8000 * MS)


def test_a_flood_of_identifiers_is_forgotten_and_the_faults_stay():
    one = injector({"kind": "drop", "message": SPEEDS})
    (frame,) = frames(SPEEDS, 1)
    for identifier in range(3 * REMEMBERED):
        assert one.pass_frame("plant", Frame(identifier, b""), MS)
        assert not one.pass_frame("plant", frame, MS)


def test_faults_act_one_after_the_other():
    """What the first drops, the second cannot repeat; what it delays, the second repeats later."""
    sent = frames(SPEEDS, 5)
    assert passed(injector({"kind": "drop"}, {"kind": "repeat"}), sent) == []
    both = passed(injector({"kind": "delay", "delay_ms": 3.0}, {"kind": "repeat", "gap_ms": 2.0}), sent[:1])
    assert [at // MS for at, _ in both] == [3, 5]


def test_beginnings_and_ends_are_reported_with_the_number_of_frames_struck():
    one = injector(
        {"kind": "drop", "message": SPEEDS, "at_s": 0.1, "for_s": 0.1},
        {"kind": "corrupt", "message": SPEEDS, "at_s": 0.15},
    )
    passed(one, frames(SPEEDS, 30))
    assert reported(one) == [(100, 1, "begins"), (150, 2, "begins"), (200, 1, "ends")]
    assert [e.struck for e in one.events] == [0, 0, 10]


def test_a_kill_is_an_action_and_its_end_a_restart():
    one = injector({"kind": "kill", "process": "ecu", "at_s": 0.5, "for_s": 1.0})
    assert one.next_ns() == 500 * MS
    assert one.actions(499 * MS) == []
    assert one.actions(500 * MS) == [Action("kill", "ecu")]
    assert one.actions(500 * MS) == []
    assert one.next_ns() == 1500 * MS
    assert one.actions(1600 * MS) == [Action("restart", "ecu")]


def test_a_bus_off_is_reported_to_the_shell_too():
    one = injector({"kind": "bus_off", "node": "plant", "for_s": 1.0})
    assert one.actions(0) == [Action("bus_off", "plant")]
    assert one.actions(1000 * MS) == [Action("bus_on", "plant")]


def test_spontaneous_frames_go_onto_the_bus_of_the_other_side():
    one = injector({"kind": "babble", "from": "plant"})
    assert [side for side, _ in one.spontaneous(0)] == ["ecu"]


def test_a_live_fault_counts_from_now_and_ends_by_itself():
    one = injector()
    (frame,) = frames(SPEEDS, 1)
    answer = one.command({"command": "inject", "fault": {"kind": "drop", "for_s": 2.0}}, 1000 * MS)
    assert answer == {"ok": True, "number": 1, "fault": "drop"}
    assert not one.pass_frame("plant", frame, 1000 * MS)
    assert one.pass_frame("plant", frame, 3000 * MS)
    assert reported(one) == [(1000, 1, "begins"), (3000, 1, "ends")]


def test_a_live_fault_before_the_start_leaves_the_script_its_numbers_and_draws():
    from hil.faults.injector import Injector
    from tests.hil.faults.traffic import DATABASE, fault

    script = [fault(kind="drop", probability=0.5)]
    undisturbed, disturbed = (Injector(DATABASE, script, seed=2) for _ in range(2))
    answer = disturbed.command(
        {"command": "inject", "fault": {"kind": "bus_off", "node": "ecu", "for_s": 0.1}}, 0
    )
    assert answer["number"] == 2
    undisturbed.start(200 * MS)
    disturbed.start(200 * MS)
    (frame,) = frames(SPEEDS, 1)
    for at in range(200, 300):
        assert bool(undisturbed.pass_frame("plant", frame, at * MS)) == bool(
            disturbed.pass_frame("plant", frame, at * MS)
        )


def test_the_list_names_phase_times_and_frames():
    one = injector(
        {"kind": "drop", "message": SPEEDS, "at_s": 0.0, "for_s": 1.0},
        {"kind": "bus_off", "node": "ecu", "at_s": 2.0},
    )
    for frame in frames(SPEEDS, 3):
        one.pass_frame("plant", frame, 250 * MS)
    assert one.command({"command": "list"}, 500 * MS) == {
        "ok": True,
        "faults": [
            {"number": 1, "fault": f"drop {SPEEDS}", "phase": "active", "begins_in_s": -0.5, "ends_in_s": 0.5, "struck": 3},
            {"number": 2, "fault": "bus_off node=ecu", "phase": "waiting", "begins_in_s": 1.5, "ends_in_s": None, "struck": 0},
        ],
    }  # fmt: skip


def test_clearing_one_or_all():
    one = injector({"kind": "drop"}, {"kind": "bus_off", "node": "ecu"}, {"kind": "drop", "at_s": 9.0})
    (frame,) = frames(SPEEDS, 1)
    assert one.command({"command": "clear", "number": 2}, MS) == {"ok": True, "cleared": [2]}
    assert not one.pass_frame("plant", frame, MS)
    assert one.command({"command": "clear"}, 2 * MS) == {"ok": True, "cleared": [1, 3]}
    assert one.pass_frame("plant", frame, 10_000 * MS)
    assert one.command({"command": "clear", "number": 7}, 3 * MS) == {
        "ok": False,
        "error": "no fault 7 to clear; there are: none",
    }


def test_clearing_a_kill_restarts_the_process():
    one = injector({"kind": "kill", "process": "plant"})
    assert one.actions(0) == [Action("kill", "plant")]
    one.command({"command": "clear"}, MS)
    assert one.actions(MS) == [Action("restart", "plant")]


def test_a_wrong_command_changes_nothing_and_says_why():
    one = injector()
    wrong = one.command({"command": "inject", "fault": {"kind": "drop", "probability": 2}}, 0)
    assert wrong == {"ok": False, "error": "inject: fault.probability = 2 of 1 is outside 0..1 of 1"}
    assert one.command({"command": "inject", "fault": 3}, 0)["ok"] is False
    assert one.command({"command": "explode"}, 0)["ok"] is False
    assert one.command({"command": "list"}, 0) == {"ok": True, "faults": []}


def test_time_does_not_run_backwards():
    one = injector({"kind": "drop", "at_s": 0.1, "for_s": 0.1})
    (frame,) = frames(SPEEDS, 1)
    one.spontaneous(300 * MS)
    (planned,) = one.pass_frame("plant", frame, 150 * MS)
    assert planned.at_ns == 300 * MS
