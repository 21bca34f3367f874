"""J1939 of the ECU, asked and contended with by can-j1939, which knows only the standard, and by random frames."""

import contextlib
import itertools
import queue
import random
import time
from collections.abc import Callable, Iterator

import j1939
import pytest

from bus.frame import EXTENDED, EXTENDED_MASK, Frame
from dbc import loader_database
from dbc.j1939 import pgn, source_address
from ecu.j1939.claim import CONTENTION_NS, GLOBAL, State, message
from ecu.j1939.service import (
    ACKNOWLEDGEMENT,
    BUSY,
    COMPONENT,
    PIECE_NS,
    REFUSED,
    REQUEST,
    SOFTWARE,
)
from tests.ecu.j1939.conftest import NAME

DATABASE = loader_database()
ADDRESS = source_address(DATABASE.by_name["EcuStatus"].can_id)
TOOL = 0xF9
TICK_NS = 10_000_000
PATIENCE_S = 30.0


@pytest.fixture
def owning(service_named):
    """Makes a service that has its address."""

    def made():
        service = service_named()
        service.after_cycle(0)
        service.after_cycle(CONTENTION_NS)
        assert service.may_send()
        return service

    return made


def request(group: int, to: int = ADDRESS) -> Frame:
    return message(REQUEST, TOOL, group.to_bytes(3, "little"), to=to)


def test_the_address_is_that_of_all_messages_of_the_ecu():
    assert {source_address(c.can_id) for c in DATABASE.by_id.values() if "EstimatorEcu" in c.senders} == {
        ADDRESS
    }


def test_the_ecu_sends_nothing_before_it_has_its_address(service_named):
    service = service_named()
    (claim,) = service.after_cycle(0)
    assert source_address(claim.can_id) == ADDRESS
    for now in range(TICK_NS, CONTENTION_NS, TICK_NS):
        assert service.after_cycle(now) == []
        assert not service.may_send()
    service.after_cycle(CONTENTION_NS)
    assert service.may_send()


def test_a_lost_address_is_logged_once_and_ends_a_long_answer(owning, caplog):
    service = owning()
    assert len(service.receive(request(SOFTWARE, GLOBAL), CONTENTION_NS)) == 1
    lower = message(0xEE00, ADDRESS, bytes(8))
    service.receive(lower, CONTENTION_NS)
    service.receive(lower, CONTENTION_NS)
    assert not service.may_send()
    assert [r.getMessage().split(":")[0] for r in caplog.records] == [
        f"address 0x80 belongs to NAME {0:016X}, which ours, {int(NAME):016X}, does not outrank"
    ]
    sent = [f for k in range(100) for f in service.after_cycle(CONTENTION_NS + k * TICK_NS)]
    assert [source_address(f.can_id) for f in sent] == [0xFE]  # no address, and nothing of the answer


@pytest.mark.parametrize("group", [0xFECA, 0xFEDA, 0xFEEB, 0xEE00, 0x1234, 0x1FFFF])
def test_only_a_request_to_the_ecu_alone_is_refused(owning, group):
    """J1939-21: nobody refuses a request to all."""
    known = {pgn(c.can_id) for c in DATABASE.by_id.values() if "EstimatorEcu" in c.senders}
    refused = group not in known | {SOFTWARE, COMPONENT, 0xEE00}
    to_us, to_all, to_another = (
        owning().receive(request(group, to), CONTENTION_NS) for to in (ADDRESS, GLOBAL, 0x42)
    )
    assert to_another == []
    assert [f for f in to_all if pgn(f.can_id) == ACKNOWLEDGEMENT] == []
    answers = [f.data for f in to_us if pgn(f.can_id) == ACKNOWLEDGEMENT]
    assert answers == (
        [bytes((REFUSED, 255, 255, 255, TOOL)) + group.to_bytes(3, "little")] if refused else []
    )


def test_a_second_long_answer_waits_for_the_first(owning):
    service = owning()
    service.receive(request(SOFTWARE), CONTENTION_NS)
    (busy,) = service.receive(request(COMPONENT), CONTENTION_NS)
    assert busy.data[0] == BUSY
    now, pieces = CONTENTION_NS, []
    while len(pieces) < 3:
        now += TICK_NS
        assert now < CONTENTION_NS + 10 * PIECE_NS
        pieces += [(now, f) for f in service.after_cycle(now)]
    times = [CONTENTION_NS, *(at for at, _ in pieces)]
    # J1939-21: 50 to 200 ms between the frames of a message to all
    assert all(PIECE_NS <= b - a <= 200_000_000 for a, b in itertools.pairwise(times))
    assert len(service.receive(request(COMPONENT), now)) == 1


def test_random_frames_harm_nothing(owning):
    draw = random.Random(1)
    service, groups = owning(), [REQUEST, 0xEE00, ACKNOWLEDGEMENT, 0xEC00, 0xEB00]
    for k in range(20_000):
        can_id = draw.getrandbits(32) if k % 4 else EXTENDED | draw.choice(groups) << 8 | draw.getrandbits(16)
        frame = Frame(
            can_id, draw.randbytes(draw.choice((0, 1, 3, 3, 7, 8, 8, 64))), flags=draw.choice((0, 0, 4))
        )
        now = CONTENTION_NS + k * TICK_NS // 10
        frames = list(service.receive(frame, now))
        if k % 10 == 0:
            frames += service.after_cycle(now)
        assert all(len(f.data) == 8 and f.can_id & EXTENDED for f in frames)
        if service.state is State.LOST:
            service = owning()


class Bench:
    """The service and a controller of can-j1939 on one bus, in real time: its timers are threads."""

    def __init__(self, service) -> None:
        self.service, self._heard = service, queue.Queue[Frame]()
        self.theirs = j1939.ElectronicControlUnit(send_message=self._send)

    def _send(self, can_id: int, extended: bool, data: bytes, fd_format: bool = False) -> None:
        self._heard.put(Frame(can_id | EXTENDED, bytes(data)))

    def run_until(self, done: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE_S
        while not done():
            assert time.monotonic() < deadline
            now = time.monotonic_ns()
            frames = []
            with contextlib.suppress(queue.Empty):
                while True:
                    frames += self.service.receive(self._heard.get_nowait(), now)
            for frame in [*frames, *self.service.after_cycle(now)]:
                self.theirs.notify(frame.can_id & EXTENDED_MASK, frame.data, time.time())
            time.sleep(0.01)


@pytest.fixture
def bench(service_named) -> Iterator[Bench]:
    bench = Bench(service_named())
    yield bench
    bench.theirs.stop()


def application(bench: Bench, identity: int, address: int, *, movable: bool = False):
    name = j1939.Name(
        arbitrary_address_capable=int(movable), industry_group=3, vehicle_system=127, function=255,
        manufacturer_code=5, identity_number=identity,
    )  # fmt: skip
    made = bench.theirs.add_ca(name=name, device_address=address)
    made.start()
    return made


def test_a_foreign_controller_reads_who_the_ecu_is(bench):
    bench.run_until(bench.service.may_send)
    tool, read = application(bench, 1, TOOL), {}
    tool.subscribe(lambda priority, group, sa, at, data: read.setdefault(group, (sa, bytes(data))))
    bench.run_until(lambda: tool.state == j1939.ControllerApplication.State.NORMAL)
    for group, text in ((SOFTWARE, b"\x01loaderhil 1.2.3*"), (COMPONENT, b"loaderhil*l60*77**")):
        tool.send_request(0, group, ADDRESS)
        bench.run_until(lambda group=group: group in read)
        assert read[group] == (ADDRESS, text)


def test_a_foreign_controller_of_a_higher_name_does_not_get_the_address(bench):
    bench.run_until(bench.service.may_send)
    theirs = application(bench, 78, ADDRESS)
    bench.run_until(lambda: theirs.state == j1939.ControllerApplication.State.CANNOT_CLAIM)
    assert bench.service.may_send()


def test_a_foreign_controller_of_a_lower_name_gets_the_address(bench):
    bench.run_until(bench.service.may_send)
    theirs = application(bench, 76, ADDRESS)
    bench.run_until(lambda: bench.service.state is State.LOST)
    bench.run_until(lambda: theirs.state == j1939.ControllerApplication.State.NORMAL)
    assert theirs.device_address == ADDRESS
    assert not bench.service.may_send()
