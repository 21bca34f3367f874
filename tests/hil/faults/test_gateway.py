"""The gateway's core with the real injector: the same script does there what it does in lockstep."""

from dbc import loader_database
from hil.faults.wire import FaultyWire
from hil.gateway.core import GatewayCore
from hil.gateway.routes import SIDES, Routes
from tests.hil.faults.traffic import MS, frames, injector

FAULTS = (
    {"kind": "drop", "message": "WheelSpeeds", "probability": 0.3},
    {"kind": "delay", "message": "BodyRates", "delay_ms": 4.0},
    {"kind": "reorder", "message": "Articulation", "probability": 0.5},
    {"kind": "corrupt", "message": "BodyAcceleration", "probability": 0.5},
    {"kind": "freeze", "message": "WheelSpeedsRear", "signal": "Left", "at_s": 0.2},
)
MESSAGES = ("WheelSpeedsFront", "WheelSpeedsRear", "BodyRates", "Articulation", "BodyAcceleration")


def sent():
    columns = [frames(message, 60, lambda n: {}) for message in MESSAGES]
    return [(n * 10 * MS, list(row)) for n, row in enumerate(zip(*columns, strict=True))]


def by_message(arrived):
    return {
        message: [f.data for f in arrived if f.can_id == loader_database().by_name[message].can_id]
        for message in MESSAGES
    }


def test_gateway_and_lockstep_let_the_same_frames_through():
    core = GatewayCore(Routes(loader_database()), injector=injector(*FAULTS, seed=5))
    wire = FaultyWire(injector(*FAULTS, seed=5))
    through_gateway, over_wire = [], []
    for at_ns, row in sent():
        over_wire += [frame for _, frame in wire.take(at_ns)]
        wire.put(row, at_ns, "plant")
        core.advance(at_ns)
        core.receive("plant", row, at_ns)
        through_gateway += core.waiting("ecu")
        core.waiting("ecu").clear()
    core.advance(10_000 * MS)
    through_gateway += core.waiting("ecu")
    over_wire += [frame for _, frame in wire.take(10_000 * MS)]
    assert by_message(through_gateway) == by_message(over_wire)
    assert len(through_gateway) < 60 * len(MESSAGES)


def test_a_babbling_node_and_a_bus_off_reach_the_gateway():
    core = GatewayCore(Routes(loader_database()), injector=injector({"kind": "babble", "from": "plant"}))
    core.advance(MS)
    assert [f.can_id for f in core.waiting("ecu")] == [0] * 5
    assert not core.waiting("plant")

    core = GatewayCore(
        Routes(loader_database()), injector=injector({"kind": "bus_off", "node": "ecu", "for_s": 0.1})
    )
    core.advance(0)
    core.receive("plant", frames("BodyRates", 1), MS)
    assert not any(core.waiting(side) for side in SIDES)
    core.advance(100 * MS)
    core.receive("plant", frames("BodyRates", 1), 101 * MS)
    assert len(core.waiting("ecu")) == 1


def test_a_kill_is_left_to_the_shell():
    core = GatewayCore(Routes(loader_database()), injector=injector({"kind": "kill", "process": "ecu"}))
    assert [(a.kind, a.target) for a in core.advance(0)] == [("kill", "ecu")]
