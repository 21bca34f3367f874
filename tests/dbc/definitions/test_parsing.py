"""The text of a DBC is taken as cantools takes it from a file."""

import cantools
import pytest

from dbc.database import Database

DBC = b"""VERSION ""
BU_: Node
BO_ 256 Message: 8 Node
 SG_ Signal : 0|8@1+ (1,0) [0|0] "%s" Node
CM_ BO_ 256 "first
second";
"""


@pytest.mark.parametrize("unit", [b"\xb0C", b"\xb5m", b"\x81", b"\xff\xfe"])
@pytest.mark.parametrize("ends", [b"\n", b"\r\n", b"\r"])
def test_units_and_comments_are_those_of_cantools(tmp_path, unit, ends):
    file = tmp_path / "coded.dbc"
    file.write_bytes((DBC % unit).replace(b"\n", ends))
    codec = Database.from_file(file).by_name["Message"]
    [message] = cantools.database.load_file(file).messages
    assert codec.by_signal["Signal"].unit == message.signals[0].unit
    assert codec.comment == message.comment
