"""Real recordings: every decodable frame gives cantools' values."""

import math

import cantools
import pytest

from dbc import FOLDER
from dbc.columns import ColumnDecoder
from dbc.database import Database
from dbc.recordings.logfile import read_candump

pytestmark = pytest.mark.data


def assert_equals_cantools(table, columns, reference):
    values = 0
    for name, found in columns.items():
        message = reference.get_message_by_name(name)
        for k, row in enumerate(found.rows):
            data = bytes(table.data[row, : message.length])
            for signal, theirs in message.decode(data, decode_choices=False).items():
                ours = found.signals[signal][k]
                assert ours == theirs or (math.isnan(ours) and math.isnan(theirs)), (
                    f"{name}.{signal} row {row}"
                )
                values += 1
    return values


def test_a_real_car(recordings):
    folder = recordings / "comma2k19_rav4"
    file = folder / "_toyota_2017.dbc"
    table = read_candump(folder / "segment40_can.candump.log.gz")
    assert len(table) == 98_800
    decoder = ColumnDecoder(Database.from_file(file, strict=False))
    columns = decoder.decode(table)
    assert assert_equals_cantools(table, columns, cantools.database.load_file(file, strict=False)) > 170_000
    decoded = sum(c.rows.size for c in columns.values())
    assert decoded + sum(decoder.undecodable(table).values()) + sum(decoder.short(table).values()) == len(
        table
    )


@pytest.mark.parametrize("name", ["bucket_manipulation", "hydraulics", "idling", "rev_up_down", "startUp"])
def test_a_real_tractor(recordings, name):
    """J1939 frames are matched by parameter group; frames longer than CAN allows (joined by the capture) are damage."""
    file = recordings / "tractorhacking_j1939" / f"{name}.candump.log"
    table = read_candump(file)
    lines = file.read_text().splitlines()
    joined = [i for i, line in enumerate(lines, 1) if len(line.split("#")[1]) > 16]
    assert [d.at for d in table.damaged] == joined[:100]
    assert len(table) == len(lines) - len(joined)
    columns = ColumnDecoder(Database.from_file(FOLDER / "j1939.dbc")).decode(table)
    assert assert_equals_cantools(table, columns, cantools.database.load_file(FOLDER / "j1939.dbc")) > 300
    if name == "idling":
        speed = columns["EEC1"].signals["EngineSpeed"]
        assert 898 <= speed.min() <= speed.max() <= 902
