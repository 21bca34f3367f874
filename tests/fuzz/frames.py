"""Random and mutated frames through the ECU, the gateway and the hub; each number always gives the same frames.

Half of the frames of a case are what the machine really sends, so that the receivers' states are reached and left; the others
are its frames with flipped bits, other lengths or signed nonsense, or frames of any identifier, kind and content.
"""

import contextlib
import math
import random
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

from bus.frame import BRS, ERROR, ESI, EXTENDED, FD, REMOTE, Frame
from bus.hub import packet
from bus.hub.client import HubTransport
from bus.transport import BusClosed
from dbc import loader_database
from dbc.protection import Protector
from tests.bus.hub.running import RunningHub, greet, raw
from tests.fuzz.mutate import mutated
from tests.fuzz.outcome import Case

FRAMES = 1000
"""Frames of one case."""
GOOD_TICKS = 250
"""Ticks of good frames after which the ECU has to be back: 2.5 s, longer than any declared way out of FAULT."""
FLAGS = (0, FD, FD | BRS, FD | BRS | ESI, 0x80, 0xFF)
LENGTHS = (0, 1, 4, 7, 8, 12, 48, 64)


class Spoiler:
    """Makes frames of one case bad. Frames stay such as a transport can deliver: identifier with its kind bits, at most 64 bytes."""

    def __init__(self, rng: random.Random) -> None:
        codecs = loader_database().by_id.values()
        self._rng = rng
        self._known = [codec.can_id for codec in codecs]
        self._signers = {codec.can_id: Protector(codec) for codec in codecs if codec.e2e_data_id is not None}
        self._lengths = {codec.can_id: codec.length for codec in codecs}

    def anything(self, at_ns: int) -> Frame:
        """A frame of any identifier, kind and content; often of a known identifier."""
        rng = self._rng
        can_id = rng.choice(
            (
                rng.choice(self._known),
                rng.getrandbits(11),
                EXTENDED | rng.getrandbits(29),
                rng.getrandbits(32),
            )
        )
        if rng.random() < 0.1:
            can_id |= rng.choice((ERROR, REMOTE, EXTENDED))
        return Frame(can_id, rng.randbytes(rng.choice(LENGTHS)), at_ns, rng.choice(FLAGS))

    def signed(self, at_ns: int) -> Frame:
        """A frame with valid counter and checksum around nonsense: no receiver can refuse it for its bits."""
        can_id = self._rng.choice(list(self._signers))
        length = self._lengths[can_id]
        nonsense = self._rng.choice((bytes(length), b"\xff" * length, self._rng.randbytes(length)))
        return Frame(can_id, self._signers[can_id].protect(nonsense), at_ns)

    def changed(self, frame: Frame) -> Frame:
        """A frame with some of its bits, its length, kind or stamp changed."""
        rng, data = self._rng, bytearray(frame.data)
        match rng.randrange(5):
            case 0 if data:
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            case 1:
                del data[rng.randint(0, len(data)) :]
            case 2:
                data += rng.randbytes(rng.randint(1, 64 - min(len(data), 63)))
            case 3:
                return frame._replace(can_id=frame.can_id ^ 1 << rng.randrange(32))
            case _:
                return frame._replace(at_ns=rng.choice((0, -1, 2**63 - 1, frame.at_ns - 10**9, frame.at_ns)))
        return frame._replace(data=bytes(data[:64]))

    def spoiled(self, frame: Frame) -> list[Frame]:
        """The frame itself or bad ones beside it or in its place."""
        match self._rng.randrange(8):
            case 0:
                return [self.changed(frame)]
            case 1:
                return [self.signed(frame.at_ns), frame]
            case 2:
                return [self.anything(frame.at_ns), frame]
            case 3:
                return []
            case _:
                return [frame]


def through_ecu(number: int) -> tuple[int, int]:
    """Frames into the ECU's cycle: it answers every tick with finite estimates, and works again once the frames are good."""
    from ecu.calibration import load_calibration
    from ecu.cycle import EcuCycle
    from ecu.states import State
    from tests.ecu.machine import PERIOD_NS, FakeMachine, decoded

    rng = random.Random(f"ecu/{number}")
    ecu = EcuCycle(
        load_calibration(), form=rng.choice(("corrected", "printed")), detect_faults=rng.random() < 0.5
    )
    machine, spoiler, taken = FakeMachine(), Spoiler(rng), 0

    def tick(spoil: Callable[[Frame], list[Frame]]) -> int:
        now = machine.now_ns
        frames = [new for frame in machine.frames() for new in spoil(frame)]
        for frame in frames:
            ecu.receive(frame, now)
        result = ecu.tick(now + PERIOD_NS // 2)
        assert all(map(math.isfinite, result.estimates)), "an estimate is not finite"
        decoded(result.frames)
        return len(frames)

    while taken < FRAMES:
        taken += tick(spoiler.spoiled)
    # now and then, because it takes twice as long as the frames themselves
    if number % 20 == 0:
        taken += sum(tick(lambda frame: [frame]) for _ in range(GOOD_TICKS))
        assert ecu.state in (State.RUNNING, State.DEGRADED), f"{ecu.state} after good frames"
    return taken, taken


def through_services(number: int) -> tuple[int, int]:
    """Commands and noise into XCP and UDS beside a running cycle: no frame raises, and without the key no number changes."""
    from tests.ecu.uds.tool import UdsEcu
    from tests.ecu.xcp.tool import Ecu

    rng = random.Random(f"services/{number}")
    ecu = rng.choice((Ecu, UdsEcu))(secret=None)
    channel, calibration = ecu.channel, ecu.cycle.calibration
    taken = answered = 0
    while taken < FRAMES:
        for _ in range(50):
            data = bytearray(rng.randbytes(rng.randint(0, 8)))
            if len(data) > 1 and rng.random() < 0.8:
                # a command of XCP, or the length of a single frame of UDS and a service
                data[0] = rng.randint(0xD0, 0xFF) if type(ecu) is Ecu else len(data) - 1
                data[1] = rng.choice((0, 1, 2, 3, 0x10, 0x11, 0x14, 0x19, 0x22, 0x27, 0x31, 0x3E))
            flags = rng.choice(FLAGS) if rng.random() < 0.05 else 0
            frame = Frame(channel.receive, bytes(data), ecu.now_ns, flags)
            answers = ecu.service.receive(frame, ecu.now_ns)
            answered += bool(answers)
            assert all(each.can_id == channel.send and len(each.data) <= 8 for each in answers)
            taken += 1
        ecu.cycles(1)
        assert ecu.cycle.calibration is calibration, "a tool without the key has changed the calibration"
    return taken, answered


def through_gateway(number: int) -> tuple[int, int]:
    """Frames into the gateway's core with faults of every class being injected: each is passed, kept back, lost or waiting, and counted."""
    from hil.faults.injector import Injector
    from hil.faults.table import read_fault
    from hil.gateway.core import GatewayCore
    from hil.gateway.routes import SIDES, Routes
    from hil.gateway.watcher import Watcher
    from tests.ecu.machine import PERIOD_NS, FakeMachine

    rng = random.Random(f"gateway/{number}")
    routes, spoiler, machine = Routes(loader_database()), Spoiler(rng), FakeMachine()
    injector = Injector(loader_database(), [read_fault(table, loader_database()) for table in _faults(rng)])
    core = GatewayCore(
        routes, injector=injector, watcher=Watcher(routes), queue_frames=rng.choice((1, 64, 4096))
    )
    core.start(0)
    taken = passed = 0
    while taken < FRAMES:
        now = machine.now_ns
        for side in SIDES:
            frames = [new for frame in machine.frames() for new in spoiler.spoiled(frame)]
            core.receive(side, frames, now)
            core.nothing_came(side, now)
            taken += len(frames)
        core.advance(now + PERIOD_NS // 2)
        core.findings()
        for side in SIDES:
            waiting = core.waiting(side)
            assert len(waiting) <= 4096, "the queue has no bound"
            passed += len(waiting)
            waiting.clear()
    assert sum(counts.received for counts in core.counts.values()) == taken
    return taken, min(passed, taken)


def _faults(rng: random.Random) -> list:
    from configuration import CheckedTable

    signal = {"message": "Articulation", "signal": "ArticulationAngle"}
    tables = [
        {"kind": "drop", "message": "WheelSpeedsFront", "probability": 0.5},
        {"kind": "delay", "message": "BodyRates", "delay_ms": 15.0},
        {"kind": "reorder", "message": "BodyAcceleration"},
        {"kind": "repeat", "message": "DriverDemand"},
        {"kind": "corrupt", "message": "LinkageAngles", "probability": 0.5},
        {"kind": "freeze", **signal},
        {"kind": "offset", **signal, "offset": 5.0},
        {"kind": "spike", **signal, "height": 5.0, "every": 3},
    ]
    return [CheckedTable(table, file="fuzz", section="fault") for table in rng.sample(tables, 4)]


class ThroughHub:
    """Bytes into a running hub: whatever a client sends, two others still reach one another."""

    def __init__(self, path: str, sender: HubTransport, hearer: HubTransport) -> None:
        self._path, self._sender, self._hearer = path, sender, hearer

    def __call__(self, number: int) -> tuple[int, int]:
        """The records that a bad client sent until it lost its connection, and those that it sent at all."""
        rng = random.Random(f"hub/{number}")
        spoiler = Spoiler(rng)
        records = [_record(spoiler.anything(0), rng) for _ in range(FRAMES)]
        sent = 0
        with raw(self._path) as client:
            if rng.random() < 0.95:
                greet(client, "bad")
            client.settimeout(None)
            # in pieces of any size: a record may end anywhere
            text = b"".join(records)
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                while text:
                    piece, text = text[: (size := rng.randint(1, 64 * packet.SIZE))], text[size:]
                    client.sendall(piece)
                    sent += len(piece)
                    self._hearer.drain(4096)
        self._serves_on(number)
        return max(sent // packet.SIZE, 1), sent // packet.SIZE

    def _serves_on(self, number: int) -> None:
        """A frame of one good client arrives at the other; AssertionError if it does not."""
        probe = number.to_bytes(8, "big")
        self._sender.send(Frame(0x7FF, probe))
        with socket.socket(fileno=socket.dup(self._hearer.fileno())) as heard:
            heard.settimeout(10.0)
            while True:
                try:
                    if any(
                        frame.can_id == 0x7FF and frame.data == probe for frame in self._hearer.drain(4096)
                    ):
                        return
                    heard.recv(1, socket.MSG_PEEK)
                except (TimeoutError, BusClosed) as error:
                    raise AssertionError(f"the hub serves nobody any more: {error!r}") from None


def _record(frame: Frame, rng: random.Random) -> bytes:
    """A frame as a client sends it; now and then a record that no client of ours would make."""
    length = len(frame.data)
    content = packet.LAYOUT.pack(frame.can_id, length, frame.flags & 0xFF, 0, frame.data, 0, 0)
    if rng.random() < 0.995:
        return content
    hello = packet.control({"hello": "again", "protocol": packet.PROTOCOL})
    return rng.choice(
        (mutated(content, [content], rng), mutated(hello, [hello], rng), rng.randbytes(packet.SIZE))
    )


@contextlib.contextmanager
def _ecu() -> Iterator[Case]:
    # both forms of the equations, with and without detection: compiling them is no case's fault
    for number in range(8):
        with contextlib.suppress(Exception):
            through_ecu(number)
    yield through_ecu


@contextlib.contextmanager
def _both() -> Iterator[Case]:
    from tests.fuzz.both import through_both  # needs a C compiler, which the other receivers do not

    through_both(0)
    yield through_both


@contextlib.contextmanager
def _services_in_both(folder: Path) -> Iterator[Case]:
    from tests.deploy.c.beside import services_library  # needs a C compiler
    from tests.fuzz.both import ServicesInBoth

    case = ServicesInBoth(services_library(folder))
    for number in range(2):
        case(number)
    yield case


@contextlib.contextmanager
def _services() -> Iterator[Case]:
    # both services: loading and compiling what they stand beside is no case's fault
    for number in range(4):
        with contextlib.suppress(Exception):
            through_services(number)
    yield through_services


@contextlib.contextmanager
def _hub(folder: Path) -> Iterator[Case]:
    hub = RunningHub(str(folder / "hub"))
    try:
        with hub.connect() as sender, hub.connect() as hearer:
            yield ThroughHub(hub.path, sender, hearer)
    finally:
        hub.stop()


RECEIVERS: dict[str, Callable[[Path], contextlib.AbstractContextManager[Case]]] = {
    "frames to the ECU": lambda _: _ecu(),
    "frames to the ECU in Python and C": lambda _: _both(),
    "frames to XCP and UDS": lambda _: _services(),
    "frames to XCP and UDS in Python and C": _services_in_both,
    "frames to the gateway": lambda _: contextlib.nullcontext(through_gateway),
    "frames to the hub": _hub,
}
"""What carries out the cases of a receiver; the folder is for its socket."""
