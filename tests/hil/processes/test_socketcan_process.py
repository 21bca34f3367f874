"""Commands on CAN interfaces that are missing or down: one line with the cause and what helps."""

from collections.abc import Iterator

import pytest

from bus.socketcan.can_socket import kernel_has_can
from tests.bus.vcan import ip
from tests.hil.processes.test_hub_process import one_line

pytestmark = pytest.mark.socketcan


@pytest.fixture
def interface_down() -> Iterator[str]:
    if not kernel_has_can():
        pytest.skip("this kernel has no CAN; run scripts/with-vcan .venv/bin/pytest -m socketcan")
    name = "vcan8"
    ip("link", "add", "dev", name, "type", "vcan")
    yield name
    ip("link", "del", name)


def test_an_interface_that_is_down(interface_down: str) -> None:
    says = one_line("plant", "standstill", "--bus", f"socketcan:{interface_down}")
    assert f"socketcan:{interface_down}: it is down; bring it up: sudo ip link set vcan8 up" in says


def test_an_interface_that_is_missing(interface_down: str) -> None:
    says = one_line("ecu", "--bus", "socketcan:can7")
    assert "socketcan:can7: no such CAN interface (there are: " in says
    assert interface_down in says
    assert "is the adapter plugged in, and its driver loaded?" in says
