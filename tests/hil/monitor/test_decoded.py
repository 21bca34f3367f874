"""Decoded lines and JSON: cantools' values, the DBC's names and units, and what is wrong with a frame."""

import json
import re

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import ERROR, Frame
from dbc import FOLDER, loader_database
from dbc.database import Database
from dbc.protection import Protector
from dbc.signal import Signal
from hil.monitor.candump import Stamp
from hil.monitor.decoded import JsonView, LinesView
from hil.monitor.messages import ABSENT, Field, Messages, Selection, SelectionError
from hil.monitor.source import Batch
from tests.hil.monitor.traffic import MS, can_id_of, machine_frames, messages

REFERENCE = cantools.database.load_file(FOLDER / "loader.dbc")


def batch(*frames: Frame, bus: str = "can0") -> Batch:
    return Batch([(bus, frame) for frame in frames], 5_000_000_000)


def test_json_holds_cantools_values_names_and_units() -> None:
    frames = machine_frames()
    lines = JsonView(messages(protection=True)).text(batch(*frames)).splitlines()
    assert len(lines) == len(frames) > 500
    for frame, line in zip(frames, lines, strict=True):
        ours = json.loads(line)
        message = REFERENCE.get_message_by_frame_id(frame.identifier)
        plain, named = (message.decode(frame.data, decode_choices=choices) for choices in (False, True))
        assert ours["message"] == message.name
        assert ours["senders"] == message.senders
        assert ours["time_s"] == (frame.at_ns + 5_000_000_000) / 1e9
        assert {name: signal["value"] for name, signal in ours["signals"].items()} == plain
        for signal in message.signals:
            shown = ours["signals"][signal.name]
            assert shown["unit"] == (signal.unit or "")
            if signal.choices and plain[signal.name] in signal.choices:
                assert shown["name"] == str(named[signal.name])


def test_lines_hold_the_same_to_within_what_the_signal_resolves() -> None:
    frames = machine_frames()
    lines = LinesView(messages(protection=True), Stamp.NONE).text(batch(*frames)).splitlines()
    for frame, line in zip(frames, lines, strict=True):
        message = REFERENCE.get_message_by_frame_id(frame.identifier)
        values = message.decode(frame.data, decode_choices=False)
        bus, name, signals = line.split(maxsplit=2)
        assert (bus, name) == ("can0", message.name)
        shown = dict(re.findall(r"(\w+)=([^,]+)", signals))
        assert shown.keys() == values.keys()
        for signal in message.signals:
            number, _, unit = shown[signal.name].partition(" ")
            if not signal.choices and number != ABSENT:
                assert float(number) == pytest.approx(values[signal.name], abs=abs(signal.scale) * 0.51)
                assert unit == (signal.unit or "")


def test_the_stamp_of_lines_is_candumps() -> None:
    frame = machine_frames()[0]._replace(at_ns=1_234_567)
    assert LinesView(messages(), Stamp.ABSOLUTE).text(batch(frame)).startswith("(0000000005.001234) can0  ")


steps = st.sampled_from([1, 2, 0.5, 0.1, 0.04, 0.002, 0.00390625, 1e-4])


@given(steps, st.sampled_from([0, -1.5, 0.25, -273, 100]), st.integers(-1000, 1000))
def test_neighbouring_values_never_look_alike(scale: float, offset: float, raw: int) -> None:
    field = Field(Signal(name="S", start=0, length=16, signed=True, scale=scale, offset=offset, unit="x"))
    one, other = raw * scale + offset, (raw + 1) * scale + offset
    assert field.text(one) != field.text(other)
    assert float(field.text(one).split()[0]) == pytest.approx(one, abs=scale / 2)


def test_what_is_not_available_is_said_so() -> None:
    codec = loader_database().by_name["LiftPressure"]
    view = LinesView(messages(), Stamp.NONE)
    assert (
        view.text(batch(Frame(codec.can_id, b"\xff" * 8)))
        == f"can0  LiftPressure LiftCylinderPressure={ABSENT}\n"
    )


def test_a_number_that_json_lacks_is_null(tmp_path) -> None:
    dbc = tmp_path / "float.dbc"
    dbc.write_text(
        'VERSION ""\nBU_: A\nBO_ 1 M: 4 A\n SG_ F : 0|32@1- (1,0) [0|0] "" A\nSIG_VALTYPE_ 1 F : 1;\n'
    )
    view = JsonView(Messages([Database.from_file(dbc)], Selection()))
    line = json.loads(view.text(batch(Frame(1, b"\x00\x00\xc0\x7f"))))
    assert line["signals"]["F"]["value"] is None


def test_multiplexed_messages_show_what_each_frame_carries(tmp_path) -> None:
    dbc = tmp_path / "mux.dbc"
    dbc.write_text(
        'VERSION ""\nBU_: A\nBO_ 1 M: 2 A\n SG_ K M : 0|8@1+ (1,0) [0|0] "" A\n'
        ' SG_ P m0 : 8|8@1+ (1,0) [0|0] "" A\n SG_ Q m1 : 8|8@1+ (1,0) [0|0] "" A\n'
    )
    view = LinesView(Messages([Database.from_file(dbc)], Selection()), Stamp.NONE)
    shown = view.text(batch(Frame(1, b"\0\7"), Frame(1, b"\1\7"), Frame(1, b"\2\7"))).splitlines()
    assert shown[:2] == ["can0  M K=0, P=7", "can0  M K=1, Q=7"]
    assert shown[2] == "can0  001#0207  [M: multiplexer K is 2, the DBC knows 0, 1]"


def test_unknown_and_short_frames_and_error_frames_are_shown_as_they_are() -> None:
    known = can_id_of("Articulation")
    frames = (Frame(0x7FF, b"\x12"), Frame(ERROR | 0x40, bytes(8)), Frame(known, b"\x01"))
    lines = LinesView(messages(), Stamp.NONE).text(batch(*frames)).splitlines()
    assert lines[0] == "can0  7FF#12"
    assert lines[1] == "can0  20000040#0000000000000000  [bus off]"
    assert "1 bytes of data, the DBC says 8" in lines[2]
    objects = [json.loads(line) for line in JsonView(messages()).text(batch(*frames)).splitlines()]
    assert [each.get("data") for each in objects] == ["12", "0" * 16, "01"]
    assert objects[1]["findings"] == ["bus off"]
    assert "message" not in objects[2]


def test_broken_protection_is_reported_per_bus() -> None:
    codec = loader_database().by_name["Articulation"]
    protector = Protector(codec)
    good = [protector.protect(bytes(8)) for _ in range(5)]
    broken = bytes([good[1][0] ^ 0x5A, *good[1][1:]])
    data = (good[0], broken, good[1], good[1], good[4])
    view = LinesView(messages(), Stamp.NONE)
    lines = view.text(batch(*(Frame(codec.can_id, d, i * 10 * MS) for i, d in enumerate(data)))).splitlines()
    said = [line.partition("  [")[2] for line in lines]
    assert said[0] == said[2] == ""
    assert "CRC" in said[1]
    assert said[3] == "counter repeated]"
    assert said[4] == "2 frames lost before this one]"
    assert "[" not in view.text(batch(Frame(codec.can_id, good[0]), bus="can1"))


@pytest.mark.parametrize(
    ("selection", "expected"),
    [
        ({"messages": ["Articulation"]}, {"Articulation"}),
        ({"messages": ["WheelS*"]}, {"WheelSpeedsFront", "WheelSpeedsRear"}),
        ({"senders": ["EstimatorEcu"]}, set()),
        ({"signals": ["YawRate"]}, {"BodyRates"}),
        ({"signals": ["WheelSpeedsFront.Left"]}, {"WheelSpeedsFront"}),
        ({"signals": ["*Angle"], "messages": ["SlopeSensor"]}, {"SlopeSensor"}),
    ],
)
def test_only_what_was_asked_for_is_shown(selection: dict, expected: set[str]) -> None:
    frames = batch(*machine_frames(), Frame(0x7FF, b""), Frame(ERROR | 0x40, bytes(8)))
    lines = LinesView(messages(**selection), Stamp.NONE).text(frames).splitlines()
    assert {line.split()[1] for line in lines} == expected
    objects = JsonView(messages(**selection)).text(frames).splitlines()
    assert {json.loads(each)["message"] for each in objects} == expected
    if "signals" in selection:
        pattern = selection["signals"][0].rpartition(".")[2].replace("*", ".*")
        names = {name for each in objects for name in json.loads(each)["signals"]}
        assert names
        assert all(re.fullmatch(pattern, name) for name in names)


@pytest.mark.parametrize(
    ("selection", "says"),
    [
        (
            {"messages": ["Articulatoin"]},
            "no message 'Articulatoin' in .*loader.dbc.*did you mean Articulation",
        ),
        ({"signals": ["YawRat"]}, "no signal 'YawRat'.*did you mean YawRate"),
        ({"senders": ["Nobody*"]}, "no sender 'Nobody\\*'"),
        ({"senders": ["Machine"], "messages": ["Limits"]}, "no message fulfils all conditions"),
    ],
)
def test_what_no_dbc_has_is_refused(selection: dict, says: str) -> None:
    with pytest.raises(SelectionError, match=says):
        messages(**selection)
