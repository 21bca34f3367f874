"""What the tests of buses share."""

import pytest

from bus.socketcan.can_socket import kernel_has_can
from bus.socketcan.link import can_interfaces
from tests.bus.vcan import INTERFACE


@pytest.fixture
def vcan() -> None:
    """Skip where there is no virtual CAN interface."""
    if not kernel_has_can():
        pytest.skip("this kernel has no CAN; run scripts/with-vcan .venv/bin/pytest -m socketcan")
    if INTERFACE not in can_interfaces():
        pytest.skip(f"there is no {INTERFACE}; run scripts/with-vcan .venv/bin/pytest -m socketcan")
