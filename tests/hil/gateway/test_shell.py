"""The loop on real transports, any pair of them, without a process of its own."""

import select
from contextlib import ExitStack
from threading import Thread

import pytest

from bus.address import open_transport
from bus.frame import Frame
from bus.hub.server import Hub
from bus.transport import BusClosed
from bus.virtual import VirtualBus
from dbc import loader_database
from hil.gateway.core import GatewayCore
from hil.gateway.routes import OTHER, SIDES, Routes
from hil.gateway.shell import GatewayLoop

DATABASE = loader_database()
SENSOR = DATABASE.by_name["Articulation"].can_id
LIMITS = DATABASE.by_name["Limits"].can_id
SENT_FROM = {"plant": SENSOR, "ecu": LIMITS}


class Refusing:
    """A transport that takes nothing while `full`."""

    def __init__(self, inner):
        self._inner = inner
        self.full = False

    def send(self, frame):
        return not self.full and self._inner.send(frame)

    def __getattr__(self, name):
        return getattr(self._inner, name)


@pytest.fixture
def stack():
    with ExitStack() as stack:
        yield stack


def an_end(stack, kind, tmp_path, name):
    """(the gateway's transport, somebody else's) on a bus of its own."""
    if kind == "virtual":
        bus = VirtualBus()
        return stack.enter_context(bus.connect()), stack.enter_context(bus.connect())
    hub = stack.enter_context(Hub(str(tmp_path / name)))
    thread = Thread(target=hub.run)
    thread.start()
    stack.callback(thread.join)
    stack.callback(hub.stop)
    return tuple(stack.enter_context(open_transport(f"hub:{hub.path}")) for _ in range(2))


def serve_until(loop, done):
    """Serve as the process does, until `done`; a second without anything to do is a failure."""
    while not done():
        assert select.select([loop.fileno()], [], [], 1.0)[0], "the gateway has nothing to do"
        loop.serve()


@pytest.mark.parametrize("plant_kind", ["virtual", "hub"])
@pytest.mark.parametrize("ecu_kind", ["virtual", "hub"])
def test_frames_cross_between_any_pair_of_transports(stack, tmp_path, plant_kind, ecu_kind):
    ends = {
        "plant": an_end(stack, plant_kind, tmp_path, "plant"),
        "ecu": an_end(stack, ecu_kind, tmp_path, "ecu"),
    }
    core = GatewayCore(Routes(DATABASE))
    delays = []
    loop = GatewayLoop(core, {side: ends[side][0] for side in SIDES}, passed=delays.append)
    stack.enter_context(loop)
    sent = {side: [Frame(SENT_FROM[side], n.to_bytes(8, "big")) for n in range(200)] for side in SIDES}
    for side in SIDES:
        for frame in sent[side]:
            assert ends[side][1].send(frame)
    serve_until(loop, lambda: all(core.counts[side].sent == 200 for side in SIDES))
    for side in SIDES:
        heard = []
        while len(heard) < 200:
            assert select.select([ends[OTHER[side]][1].fileno()], [], [], 1.0)[0]
            heard += ends[OTHER[side]][1].drain()
        assert [(f.can_id, f.data) for f in heard] == [(f.can_id, f.data) for f in sent[side]]
    assert len(delays) == 400
    assert all(0 <= delay < 60_000_000_000 for delay in delays)


def test_a_bus_that_takes_nothing_holds_up_its_own_direction_only(stack, tmp_path):
    plant, machine = an_end(stack, "virtual", tmp_path, "plant")
    ecu, controller = an_end(stack, "virtual", tmp_path, "ecu")
    full = Refusing(ecu)
    full.full = True
    core = GatewayCore(Routes(DATABASE))
    loop = stack.enter_context(GatewayLoop(core, {"plant": plant, "ecu": full}))
    for n in range(10):
        machine.send(Frame(SENSOR, bytes([n] * 8)))
        controller.send(Frame(LIMITS, bytes([n] * 8)))
    serve_until(loop, lambda: len(machine.drain()) == 10)
    assert controller.drain() == []
    assert core.counts["ecu"].held > 0
    full.full = False
    serve_until(loop, lambda: core.counts["ecu"].sent == 10)  # tried again by itself
    assert [frame.data[0] for frame in controller.drain()] == list(range(10))
    assert core.counts["ecu"].overflowed == 0


def test_the_end_of_either_bus_is_not_silence(stack):
    buses = [VirtualBus(), VirtualBus()]
    transports = dict(zip(SIDES, (stack.enter_context(bus.connect()) for bus in buses), strict=True))
    loop = stack.enter_context(GatewayLoop(GatewayCore(Routes(DATABASE)), transports))
    buses[1].close()
    with pytest.raises(BusClosed):
        serve_until(loop, lambda: False)


def test_findings_are_reported(stack, tmp_path):
    plant, machine = an_end(stack, "virtual", tmp_path, "plant")
    ecu, _ = an_end(stack, "virtual", tmp_path, "ecu")
    findings = []
    core = GatewayCore(Routes(DATABASE))
    loop = stack.enter_context(
        GatewayLoop(core, {"plant": plant, "ecu": ecu}, found=lambda side, finding: findings.append(finding))
    )
    machine.send(Frame(LIMITS, bytes(8)))
    serve_until(loop, lambda: findings)
    assert "other side" in str(findings[0])


def test_the_run_begins_with_the_plants_first_frame(stack, tmp_path):
    plant, machine = an_end(stack, "virtual", tmp_path, "plant")
    ecu, controller = an_end(stack, "virtual", tmp_path, "ecu")
    core = GatewayCore(Routes(DATABASE))
    loop = stack.enter_context(GatewayLoop(core, {"plant": plant, "ecu": ecu}))
    controller.send(Frame(LIMITS, bytes(8)))
    serve_until(loop, machine.drain)
    assert core.started_ns is None
    machine.send(Frame(SENSOR, bytes(8)))
    serve_until(loop, controller.drain)
    began = core.started_ns
    assert began is not None
    machine.send(Frame(SENSOR, bytes(8)))
    serve_until(loop, controller.drain)
    assert core.started_ns == began
