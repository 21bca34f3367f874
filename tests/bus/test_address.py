"""Addresses of buses."""

import contextlib
from pathlib import Path

import pytest

from bus.address import inside_computer, open_transport
from bus.frame import Frame
from bus.transport import BusUnavailable


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("", "no address of a bus; write hub:/path"),
        ("can0", "'can0' is no address of a bus; write socketcan:can0$"),
        ("/tmp/loader.hub", "write hub:/tmp/loader.hub$"),
        ("@bench", "write hub:@bench$"),
        ("hub:", "'hub:' is no address"),
        ("kvaser:0", "no kind of bus 'kvaser'; write hub:/path"),
    ],
)
def test_an_address_that_means_nothing_is_answered_with_the_forms_that_do(address: str, says: str) -> None:
    with pytest.raises(BusUnavailable, match=says):
        open_transport(address)


def test_a_hub_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(BusUnavailable, match="there is no hub"):
        open_transport(f"hub:{tmp_path}/hub")


def test_virtual_buses_are_shared_by_name() -> None:
    with contextlib.ExitStack() as stack:
        sender, receiver, stranger = (
            stack.enter_context(open_transport(f"virtual:{name}")) for name in ("x", "x", "y")
        )
        sender.send(Frame(1, b""))
        assert len(receiver.drain()) == 1
        assert stranger.drain() == []


def test_only_an_interface_with_a_device_leads_out_of_the_computer(tmp_path: Path) -> None:
    (tmp_path / "can0" / "device").mkdir(parents=True)
    (tmp_path / "vcan0").mkdir()
    assert not inside_computer("socketcan:can0", tmp_path)
    for address in ("socketcan:vcan0", "hub:/tmp/loader.hub", "virtual:x"):
        assert inside_computer(address, tmp_path)
