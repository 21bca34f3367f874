"""The real unit on a real transport with somebody who answers: the whole path but the ECU itself."""

import asyncio
import time
from dataclasses import replace

import pytest

from bus.frame import Frame
from bus.transport import Transport
from bus.virtual import VirtualBus
from dbc import loader_database
from dbc.protection import Protector
from plant import node
from plant.sheets.machine import load_machine
from plant.unit.scenario import load_scenario
from plant.unit.unit import PlantUnit

DATABASE = loader_database()


class Answerer:
    """Answers each Articulation frame with a Limits frame and an echo, as an ECU's cycle does."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._limits, self._status = DATABASE.by_name["Limits"], DATABASE.by_name["EcuStatus"]
        self._sign = {codec.name: Protector(codec) for codec in (self._limits, self._status)}
        self._articulation = DATABASE.by_name["Articulation"]
        torques = {f"{wheel}Torque": 50.0 for wheel in ("FrontLeft", "FrontRight", "RearLeft", "RearRight")}
        self.answered: list[int] = []  # sequence numbers of the samples
        self._limit = torques | {"Speed": 7.0, "ArticulationRate": 50.0}

    def answer(self) -> None:
        for frame in self._transport.drain():
            if frame.can_id == self._articulation.can_id:
                sequence = self._articulation.decode_dict(frame.data)["SampleSequence"]
                self.answered.append(int(sequence))
                self._send("Limits", self._limit)
                self._send("EcuStatus", {"EchoSequence": sequence})

    def _send(self, name: str, values: dict[str, float]) -> None:
        codec = DATABASE.by_name[name]
        data = codec.encode_dict(dict.fromkeys(codec.signals, 0.0) | values)
        self._transport.send(Frame(codec.can_id, self._sign[name].protect(data)))


def test_limits_reach_the_machine_and_every_sample_is_answered():
    scenario = replace(load_scenario("unloaded"), duration_s=1.0)
    unit = PlantUnit(load_machine("l60"), scenario, seed=1)
    bus = VirtualBus()
    findings, in_force = [], []
    with bus.connect() as near, bus.connect() as far:
        ecu = Answerer(far)

        def on_tick(ticked: PlantUnit) -> None:
            in_force.append(ticked.limits_in_force(time.monotonic_ns()).speed)
            ecu.answer()

        asyncio.run(node.run(near, unit, realtime=False, on_tick=on_tick, on_finding=findings.append))
        assert near.statistics().dropped_out == 0
    assert findings == []
    assert in_force[1:] == pytest.approx([7.0 / 3.6] * 100)
    assert ecu.answered == list(range(101))
