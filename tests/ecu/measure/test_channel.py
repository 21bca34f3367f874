"""Identifiers of a tool are refused where they would collide with the machine's."""

import pytest

from bus.frame import EXTENDED
from dbc import loader_database
from ecu.measure.access import SecretError, read_secret
from ecu.measure.channel import EXAMPLE, Channel, ChannelError

DATABASE = loader_database()


def test_identifiers_beyond_eleven_bits_are_extended():
    assert Channel.parse("0x600,1537", DATABASE) == Channel(0x600, 0x601)
    assert Channel.parse(EXAMPLE, DATABASE).receive == EXTENDED | 0x18EF80F9


@pytest.mark.parametrize(
    "text",
    ["", "1", "1,2,3", "a,b", "5,5", "0x20000000,1", "-1,2", f"{DATABASE.by_name['EcuStatus'].can_id:#x},1"],
)
def test_identifiers_that_cannot_be_used_are_refused(text):
    with pytest.raises(ChannelError, match=r"CAN identifier|different|free one"):
        Channel.parse(text, DATABASE)


def test_an_identifier_of_the_dbc_is_refused_by_its_name():
    used = DATABASE.by_name["EcuStatus"].can_id & ~EXTENDED
    with pytest.raises(ChannelError, match="EcuStatus"):
        Channel.parse(f"{used:#x},0x601", DATABASE)


@pytest.mark.parametrize("content", [b"", b"short\n", b"x" * 5000])
def test_a_secret_that_could_be_guessed_is_refused(tmp_path, content):
    file = tmp_path / "key"
    file.write_bytes(content)
    with pytest.raises(SecretError, match="16 to 4096 bytes"):
        read_secret(file)
    with pytest.raises(SecretError, match="cannot be read"):
        read_secret(tmp_path / "absent")
