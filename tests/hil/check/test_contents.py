"""Contents of frames: each planted breach is counted in its message, and an untouched recording has none."""

import sys
from pathlib import Path

import numpy as np
import pytest

from dbc import FOLDER, loader_database
from dbc.protection import sign
from dbc.recordings.logfile import FrameTable
from hil.check.check import Rules, check
from hil.check.contents import judge_contents
from hil.verdict import Result

DATABASE = loader_database()
CYCLES = 100


@pytest.fixture(scope="module")
def table():
    """One second of the example ECU, made by its own code: python-can and cantools, nothing of ours."""
    import cantools

    sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples"))
    import foreign_ecu

    database = cantools.database.load_file(FOLDER / "loader.dbc")
    frames = []
    for message in database.messages:
        if "EstimatorEcu" not in message.senders:
            continue
        every = message.cycle_time // 10
        for number, tick in enumerate(range(0, CYCLES, every)):
            data = foreign_ecu.protect(
                message, message.encode(foreign_ecu.values(message, tick, False)), number % 15
            )
            frames.append((tick * 10_000_000, message.frame_id | 0x8000_0000, data))
    frames.sort(key=lambda frame: frame[:2])
    return FrameTable(
        time_ns=np.array([at for at, _, _ in frames], np.int64),
        can_id=np.array([can_id for _, can_id, _ in frames], np.uint32),
        length=np.full(len(frames), 8, np.uint8),
        flags=np.zeros(len(frames), np.uint8),
        data=np.array([list(data) for _, _, data in frames], np.uint8),
        channel=np.zeros(len(frames), np.uint8),
        channels=("can0",),
    )  # fmt: skip


def changed(table, name, change):
    """A copy with one frame in the middle of a message changed by `change(data)`; it may return another length."""
    row = np.flatnonzero(table.can_id == DATABASE.by_name[name].can_id)[7]
    data, length = table.data.copy(), table.length.copy()
    frame = bytearray(data[row].tobytes())
    length[row] = change(frame) or 8
    data[row] = list(frame)
    return type(table)(
        **{f: getattr(table, f) for f in ("time_ns", "can_id", "flags", "channel", "channels")},
        data=data,
        length=length,
    )


def broken(table):
    done = check(table, [DATABASE], Rules(nodes=("EstimatorEcu",)))
    return done, {each.name: each for each in done.contents if each.broken or each.outside or each.undefined}


def resigned(name, values):
    """A change to other signal values, with the CRC put right again."""
    codec = DATABASE.by_name[name]

    def change(frame):
        counter = frame[1] & 0x0F
        frame[:] = codec.encode_dict(
            dict(zip(codec.signals, codec.decode(bytes(frame)), strict=True)) | values
        )
        frame[1] = frame[1] & 0xF0 | counter
        sign(frame, codec.e2e_data_id)

    return change


def test_the_example_ecu_is_in_time_and_intact(table):
    done, found = broken(table)
    assert found == {}
    assert done.intact.result is Result.PASSED
    assert done.passed, done.overall.reason


def crc(frame):
    frame[0] ^= 0xFF


def payload(frame):
    frame[5] ^= 0x10


def cut(frame):
    frame[4:] = bytes(4)
    return 4


def counter_15(frame):
    frame[1] |= 0x0F
    sign(frame, DATABASE.by_name["Limits"].e2e_data_id)


@pytest.mark.parametrize(
    ("change", "field"),
    [(crc, "wrong_crc"), (payload, "wrong_crc"), (cut, "wrong_length"), (counter_15, "wrong_counter")],
)
def test_a_broken_frame_is_counted_in_its_message_alone(table, change, field):
    done, found = broken(changed(table, "Limits", change))
    assert list(found) == ["Limits"]
    assert getattr(found["Limits"], field) == 1
    assert done.intact.result is Result.FAILED
    assert done.intact.reason.startswith("Limits: 1 of 100 frames")
    assert not done.passed


def test_another_messages_frame_is_a_wrong_crc(table):
    def masquerade(frame):
        sign(frame, DATABASE.by_name["EcuStatus"].e2e_data_id)

    assert broken(changed(table, "Limits", masquerade))[1]["Limits"].wrong_crc == 1


def test_a_value_outside_its_range_is_counted_but_the_frame_is_intact(table):
    done, found = broken(changed(table, "Limits", resigned("Limits", {"FrontLeftTorque": 50.9})))
    assert found == {}  # 51.0 kN m is the value for not available, 50.8 the largest
    done, found = broken(changed(table, "EcuStatus", resigned("EcuStatus", {"State": 5})))
    assert found["EcuStatus"].undefined == {"State": 1}
    assert found["EcuStatus"].example == "State = 5 is not in its value table"
    assert done.intact.result is Result.PASSED


def test_nothing_of_the_dbc_is_inconclusive():
    assert judge_contents([]).result is Result.INCONCLUSIVE
