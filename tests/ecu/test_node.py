"""The ECU's shell on a virtual bus in real time: it answers what it hears, counts what it missed, and ends well."""

import asyncio
import contextlib
import time
from collections.abc import Callable, Sequence

import pytest

from bus.frame import Frame
from bus.pacing import KeptTiming, readable
from bus.transport import BusClosed
from bus.virtual import VirtualBus, VirtualTransport
from dbc import loader_database
from dbc.j1939 import pgn, source_address
from dbc.protection import Checker
from dbc.protection import Finding as Check
from ecu import node
from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle, Tick
from ecu.findings import Finding, StateChanged
from ecu.j1939.claim import ADDRESS_CLAIMED, CONTENTION_NS, NULL, message
from ecu.j1939.name import Name
from ecu.j1939.service import j1939_service
from ecu.states import State
from tests.ecu.machine import FakeMachine

DATABASE = loader_database()
STATUS = DATABASE.by_name["EcuStatus"]
PATIENCE_S = 30.0
PERIOD_NS = 10_000_000
ADDRESS = source_address(STATUS.can_id)
MARK = Frame(0, b"")


class Machine:
    """Sends a tick's frames whenever the ECU has answered the tick before; keeps every answer."""

    def __init__(self, transport: VirtualTransport) -> None:
        self._transport = transport
        self._machine = FakeMachine()
        self.answers: list[Frame] = []
        self.echoes: list[float] = []

    def send(self, frame: Frame) -> None:
        self._transport.send(frame)

    def fileno(self) -> int:
        return self._transport.fileno()

    async def drive(self, ticks: int) -> None:
        for sequence in range(ticks):
            for frame in self._machine.frames():
                self._transport.send(frame)
            while sequence not in self.echoes:
                await readable(self._transport.fileno())
                self.hear()

    def hear(self) -> None:
        for frame in self._transport.drain():
            self.answers.append(frame)
            if frame.can_id == STATUS.can_id:
                self.echoes.append(STATUS.decode_dict(frame.data)["EchoSequence"])

    def last(self, name: str) -> dict[str, float]:
        codec = DATABASE.by_name[name]
        return codec.decode_dict(next(f.data for f in reversed(self.answers) if f.can_id == codec.can_id))


class Hindered(EcuCycle):
    """A cycle that keeps its shell from the timer once, for some periods."""

    hindered = 0

    def tick(self, now_ns: int) -> Tick:
        self.hindered += 1
        if self.hindered == 10:
            until = time.monotonic_ns() + 5 * PERIOD_NS
            while time.monotonic_ns() < until:
                pass
        return super().tick(now_ns)


def run(
    cycle: EcuCycle,
    play: Callable[[Machine, VirtualBus], asyncio.Future[None]],
    services: Sequence[node.BusService] = (),
) -> tuple[Machine, list[Finding], KeptTiming]:
    """The shell and a machine on one bus, until `play` is over."""
    cycle.warm_up()  # compiling does not count against the patience
    bus, findings, timing = VirtualBus(), list[Finding](), KeptTiming()

    async def both(near: VirtualTransport, machine: Machine) -> None:
        async with asyncio.timeout(PATIENCE_S):
            shell = asyncio.create_task(
                node.run(near, cycle, found=findings.append, timing=timing, services=services)
            )
            await asyncio.wait(
                [asyncio.ensure_future(play(machine, bus)), shell], return_when="FIRST_COMPLETED"
            )
            shell.cancel()
            await shell

    with bus.connect() as near, bus.connect() as far:
        machine = Machine(far)
        with contextlib.suppress(asyncio.CancelledError):
            asyncio.run(both(near, machine))
    return machine, findings, timing


def test_every_sample_is_answered_and_every_answer_is_sound():
    machine, findings, timing = run(EcuCycle(load_calibration()), lambda m, _: m.drive(30))
    assert sorted(set(machine.echoes)) == list(range(30))
    checkers = {c.can_id: Checker(c) for c in DATABASE.by_name.values() if c.e2e_data_id is not None}
    for frame in machine.answers:
        if frame.can_id in checkers:
            assert checkers[frame.can_id].check(frame.data, frame.at_ns) in (Check.OK, Check.INITIAL)
    assert StateChanged in {type(finding) for finding in findings}
    assert machine.last("EcuStatus")["State"] == State.RUNNING
    assert machine.last("EcuStatus")["ExecutionTime"] > 0
    rows = timing.columns()
    assert rows["execution_ns"].size == rows["lateness_ns"].size >= len(machine.echoes)
    assert (rows["execution_ns"] > 0).all()
    assert (rows["lateness_ns"] >= 0).all()


def test_ticks_that_were_missed_are_counted_and_reported():
    cycle = Hindered(load_calibration())
    machine, _, timing = run(cycle, lambda m, _: m.drive(40))
    assert timing.missed >= 4
    assert 4 <= machine.last("EcuStatus")["Overruns"] <= timing.missed
    assert machine.last("Warnings")["CycleOverrun"] == 1


def test_a_bus_that_ends_ends_the_shell():
    async def ending(machine: Machine, bus: VirtualBus) -> None:
        await machine.drive(3)
        bus.close()
        await asyncio.Event().wait()

    with pytest.raises(BusClosed):
        run(EcuCycle(load_calibration()), ending)


def test_a_fault_in_the_cycle_is_not_hidden():
    class Broken(EcuCycle):
        def tick(self, now_ns: int) -> Tick:
            raise ZeroDivisionError("broken")

    async def waiting(machine: Machine, bus: VirtualBus) -> None:
        await asyncio.Event().wait()

    with pytest.raises(ExceptionGroup) as caught:
        run(Broken(load_calibration()), waiting)
    assert caught.group_contains(ZeroDivisionError, match="broken")


def test_an_ecu_without_its_address_is_silent():
    """Silent while it claims, sending while it owns, silent for good once another has the address."""
    service = j1939_service(
        Name(identity=1, manufacturer=0), DATABASE, calibration="l60", version="1", random=lambda: 0
    )

    async def contended(machine: Machine, bus: VirtualBus) -> None:
        await machine.drive(30)
        machine.send(message(ADDRESS_CLAIMED, ADDRESS, bytes(8)))  # the lowest NAME of all
        while machine.answers[-1].can_id & 0xFF != NULL:
            await readable(machine.fileno())
            machine.hear()
        machine.answers.append(MARK)
        await asyncio.sleep(0.2)
        machine.hear()

    machine, _, _ = run(EcuCycle(load_calibration()), contended, [service])
    sent = [source_address(frame.can_id) for frame in machine.answers]
    claim, first = machine.answers[:2]
    assert pgn(claim.can_id) == ADDRESS_CLAIMED
    assert first.at_ns - claim.at_ns >= CONTENTION_NS - PERIOD_NS  # stamps of the bus, not of the cycle
    assert set(sent[: sent.index(NULL)]) == {ADDRESS}
    assert machine.answers[-1] is MARK
