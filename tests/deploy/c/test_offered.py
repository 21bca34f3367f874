"""`loaderhil ecu --core c` with XCP and UDS: the services of the C core beside those of the Python ECU."""

import random
import secrets
from types import SimpleNamespace

import pytest

from bus.frame import FD, Frame
from deploy.c.core import C
from ecu.calibration import calibration_table
from ecu.core import PYTHON
from ecu.offered.services import ServiceOptions, services_of
from tests.deploy.c.building import compiler
from tests.deploy.c.conftest import CALIBRATION
from tests.deploy.c.random_drives import RandomDrive
from tests.ecu.uds.tool import CHANNEL as UDS
from tests.ecu.uds.virtual_time import virtual_timers
from tests.ecu.xcp.tool import CHANNEL as XCP
from tests.ecu.xcp.tool import SECRET
from tests.fuzz.services import tool_frames, xcp_commands


@pytest.fixture(autouse=True)
def _compiler():
    compiler()


def offering(core, options, monkeypatch):
    """An ECU of this core with its services, whose seeds are 1, 2, 3 ..."""
    seeds = iter(range(1, 1 << 16))
    monkeypatch.setattr(secrets, "token_bytes", lambda n: next(seeds).to_bytes(n, "big"))
    ecu = core.ecu(CALIBRATION, detect_faults=True)
    return ecu, services_of(ecu, calibration_table(), options)


@pytest.fixture
def clock():
    """Its `now` is the time of can-isotp's links."""
    clock = SimpleNamespace(now=0)
    with virtual_timers(lambda: clock.now):
        yield clock


def test_both_cores_answer_alike_in_a_random_drive(clock, monkeypatch, tmp_path):
    """Numbers are read and written, codes read and cleared, the ECU is restarted, while signals are wild and frames damaged."""
    key = tmp_path / "key"
    key.write_bytes(SECRET)
    options = ServiceOptions(
        xcp=f"{XCP.receive & 0x1FFFFFFF:#x},{XCP.send & 0x1FFFFFFF:#x}",
        uds=f"{UDS.receive & 0x1FFFFFFF:#x},{UDS.send & 0x1FFFFFFF:#x}",
        access_key=key,
    )
    sides = [offering(core, options, monkeypatch) for core in (PYTHON, C)]
    rng, answers = random.Random(5), 0

    def alike(of_side):
        expected, found = ([(f.can_id, f.data.hex()) for f in of_side(*side)] for side in sides)
        assert found == expected
        return found

    def ask(packet, word=XCP.receive):
        nonlocal answers
        frame = Frame(word, packet)
        said = alike(lambda _, services: [a for s in services for a in s.receive(frame, clock.now)])
        answers += len(said)
        return [bytes.fromhex(data) for _, data in said]

    def ticked(ecu, services):
        for service in services:
            service.before_cycle(clock.now)
        return [
            *ecu.tick(clock.now).frames,
            *(f for service in services for f in service.after_cycle(clock.now)),
        ]

    commands, tools = xcp_commands(rng, 1_500, ask, SECRET), tool_frames(rng, 1_500)
    for frame, clock.now in RandomDrive(CALIBRATION, 5).calls(5_000):
        if frame is not None:
            for ecu, _ in sides:
                ecu.receive(frame, clock.now)
            continue
        alike(ticked)
        next(commands, None)
        if (data := next(tools, None)) is not None:
            ask(data, UDS.receive)
    assert answers > 300


def test_a_frame_of_another_kind_or_channel_is_not_answered(monkeypatch):
    ecu, services = offering(C, ServiceOptions(uds="0x610,0x611"), monkeypatch)
    (service,) = services
    assert [f.can_id for f in service.receive(Frame(0x610, b"\x02\x10\x01"), 0)] == [0x611]
    for frame in (Frame(0x610, b"\x02\x10\x01", flags=FD), Frame(0x611, b"\x02\x10\x01"), Frame(0x610, b"")):
        assert service.receive(frame, 0) == []
    assert service.may_send()
    assert ecu.tick(0).frames
