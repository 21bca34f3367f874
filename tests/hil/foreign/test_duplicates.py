"""A process that hears an identifier it sends itself: counted, reported once, and a failed verdict that names both senders."""

from bus.frame import Frame
from bus.virtual import VirtualBus
from dbc import loader_database
from hil.foreign.duplicates import OwnIdentifiers, judge_senders
from hil.verdict import Result

DATABASE = loader_database()
LIMITS, SPEEDS = (DATABASE.by_name[name] for name in ("Limits", "WheelSpeedsFront"))


def heard(*codecs):
    """What an ECU on a bus counts and reports when somebody else sends these messages."""
    bus, reported = VirtualBus(), []

    def first(name):
        reported.append(name)
        return "'intruder'"

    ours, other = OwnIdentifiers(bus.connect(), "EstimatorEcu", DATABASE, first), bus.connect()
    ours.send(Frame(LIMITS.can_id, bytes(8)))
    for codec in codecs:
        other.send(Frame(codec.can_id, bytes(8)))
    assert len(ours.drain()) == len(codecs)
    return ours, reported


def test_own_frames_and_those_of_the_other_node_are_no_duplicates():
    ours, reported = heard(SPEEDS, SPEEDS)
    assert (ours.figures(), reported) == ({}, [])


def test_a_second_sender_is_reported_once_and_counted():
    ours, reported = heard(LIMITS, SPEEDS, LIMITS)
    assert reported == ["Limits"]
    assert ours.figures() == {
        "duplicate_frames": 2,
        "duplicate_messages": "Limits",
        "duplicate_by": "'intruder'",
    }


def test_who_has_lost_its_address_sends_nothing_and_there_is_one_sender():
    bus, reported, ours_sends = VirtualBus(), [], [True]
    ours = OwnIdentifiers(bus.connect(), "EstimatorEcu", DATABASE, reported.append, lambda: ours_sends[0])
    other = bus.connect()
    ours_sends[0] = False
    other.send(Frame(LIMITS.can_id, bytes(8)))
    assert len(ours.drain()) == 1
    assert (ours.figures(), reported) == ({}, [])
    ours_sends[0] = True
    other.send(Frame(LIMITS.can_id, bytes(8)))
    ours.drain()
    assert reported == ["Limits"]


def test_the_verdict_names_both_senders():
    ours, _ = heard(LIMITS)
    statistics = {f"ecu_{key}": value for key, value in ours.figures().items()}
    (verdict,) = judge_senders(statistics, ("plant", "ecu"))
    assert verdict.result is Result.FAILED
    assert verdict.reason == "Limits: sent by our ecu process and by 'intruder', 1 frames"
    assert judge_senders({"ecu_sent": 5}, ("plant", "ecu")) == []
