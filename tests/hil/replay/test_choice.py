"""A part of a recording: by message, by sender, without a sender."""

import pytest

from bus.frame import EXTENDED, Frame
from dbc import loader_database
from hil.replay.choice import ChoiceOfFramesError, chosen_part
from testbench.frames import table_of

DATABASE = loader_database()
UNKNOWN = Frame(0x123, b"\1")
EVERYTHING = table_of([*(Frame(c.can_id, bytes(c.length)) for c in DATABASE.by_name.values()), UNKNOWN])


def names(messages=(), senders=(), without=()):
    part = chosen_part(EVERYTHING, [DATABASE], messages, senders, without)
    return {DATABASE.by_id[i].name if i & EXTENDED else "unknown" for i in part.can_id.tolist()}


def test_a_pattern_takes_the_messages_that_fit():
    assert names(["Wheel*"]) == {
        "WheelSpeedsFront",
        "WheelSpeedsRear",
        "WheelTorquesFront",
        "WheelTorquesRear",
    }


def test_sender_and_not_sender_divide_the_frames_of_the_dbc():
    ours, others = names(senders=["EstimatorEcu"]), names(without=["EstimatorEcu"])
    assert ours & others == set()
    assert ours | others == {*DATABASE.by_name, "unknown"}
    assert "unknown" in others  # whoever sends what no DBC knows, it is not that node


def test_message_and_sender_must_both_fit():
    assert names(["Limits", "BodyRates"], ["Machine"]) == {"BodyRates"}


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        ({"messages": ["Engine"]}, "no DBC has such a message"),
        ({"senders": ["Engine"]}, "there are EstimatorEcu, Machine"),
        ({"messages": ["Limits"], "senders": ["Machine"]}, "nothing left to send"),
    ],
)
def test_a_choice_of_nothing_says_why(choice, said):
    with pytest.raises(ChoiceOfFramesError, match=said):
        names(**choice)
