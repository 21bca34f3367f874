"""The core: every frame is accounted for, order holds, queues are bounded, the injector is obeyed."""

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import Frame
from dbc import loader_database
from hil.gateway.core import GatewayCore
from hil.gateway.injection import Action, Planned
from hil.gateway.routes import OTHER, SIDES, Fate, Routes

DATABASE = loader_database()
SENSOR = DATABASE.by_name["Articulation"].can_id
LIMITS = DATABASE.by_name["Limits"].can_id
STRANGE = 0x123
MS = 1_000_000


def frame(can_id, number=0):
    return Frame(can_id, number.to_bytes(8, "little"), at_ns=number + 1)


def core(**options):
    return GatewayCore(Routes(DATABASE), **options)


@dataclass
class Script:
    """An injector that does what a test wrote down."""

    becomes: object = None
    unasked: list = field(default_factory=list)
    wanted: list = field(default_factory=list)
    started_ns: int | None = None

    def start(self, now_ns):
        self.started_ns = now_ns

    def pass_frame(self, side_from, frame, now_ns):
        return self.becomes(side_from, frame, now_ns) if self.becomes else (Planned(now_ns, frame),)

    def spontaneous(self, now_ns):
        due = [(side, frame) for at_ns, side, frame in self.unasked if at_ns <= now_ns]
        self.unasked = [item for item in self.unasked if item[0] > now_ns]
        return due

    def next_ns(self):
        return min([item[0] for item in (*self.unasked, *self.wanted)], default=None)

    def actions(self, now_ns):
        due = [action for at_ns, action in self.wanted if at_ns <= now_ns]
        self.wanted = [item for item in self.wanted if item[0] > now_ns]
        return due

    def command(self, request, now_ns):
        return {}


ids = st.sampled_from([SENSOR, LIMITS, STRANGE])
batches = st.lists(st.tuples(st.sampled_from(SIDES), st.lists(ids, max_size=20)), max_size=20)


@given(batches, st.integers(1, 30), st.integers(0, 8))
def test_every_frame_is_passed_kept_back_lost_or_waiting_and_counted(sent, limit, takes):
    gateway = core(queue_frames=limit)
    given_away = dict.fromkeys(SIDES, 0)
    for side, batch in sent:
        gateway.receive(side, [frame(can_id) for can_id in batch], 0)
        for other in SIDES:
            queue = gateway.waiting(other)
            for _ in range(min(takes, len(queue))):
                queue.popleft()
                given_away[other] += 1
    for side in SIDES:
        counts, there = gateway.counts[side], gateway.counts[OTHER[side]]
        assert counts.received == sum(len(batch) for of, batch in sent if of == side)
        stayed = sum(counts.stayed.values())
        crossed = given_away[OTHER[side]] + there.overflowed + len(gateway.waiting(OTHER[side]))
        assert counts.received == stayed + crossed
        assert len(gateway.waiting(side)) <= limit


def test_order_and_content_are_kept_and_the_directions_do_not_mix():
    gateway = core()
    up, down = [frame(SENSOR, n) for n in range(50)], [frame(LIMITS, n) for n in range(50)]
    gateway.receive("plant", up, 0)
    gateway.receive("ecu", down, 0)
    assert list(gateway.waiting("ecu")) == up
    assert list(gateway.waiting("plant")) == down


def test_a_full_queue_loses_its_oldest_and_says_so_once():
    gateway = core(queue_frames=10)
    gateway.receive("plant", [frame(SENSOR, n) for n in range(13)], 5)
    assert list(gateway.waiting("ecu")) == [frame(SENSOR, n) for n in range(3, 13)]
    assert gateway.counts["ecu"].overflowed == 3
    (found,) = gateway.findings()
    assert (found.side, found.name, found.at_ns) == ("ecu", "Articulation", 5)
    assert "more than 10 frames" in str(found)
    assert gateway.findings() == []


def test_a_frame_on_the_wrong_side_stays_and_is_found_once():
    gateway = core()
    gateway.receive("plant", [frame(LIMITS, n) for n in range(7)], 3)
    assert not gateway.waiting("ecu")
    assert gateway.counts["plant"].stayed == {Fate.WRONG_SIDE: 7}
    (found,) = gateway.findings()
    assert str(found) == f"plant side: Limits {LIMITS & 0x1FFFFFFF:08X}: its sender is on the other side"


def test_findings_about_a_flood_of_identifiers_are_bounded():
    gateway = core()
    for can_id in range(0x800):
        for block in range(10):
            gateway.receive("plant", [frame(can_id + 0x800 * block)], 0)
    assert len(gateway.findings()) <= 4096


def test_an_injector_starts_with_the_run_and_decides_of_each_crossing_frame():
    script = Script(becomes=lambda side, frame, now_ns: ())
    gateway = core(injector=script)
    gateway.start(42)
    assert script.started_ns == gateway.started_ns == 42
    gateway.receive("plant", [frame(SENSOR), frame(STRANGE)], 50)
    assert not gateway.waiting("ecu")
    assert gateway.counts["plant"].stayed == {Fate.UNKNOWN: 1}


@given(st.lists(st.integers(0, 50), min_size=1, max_size=60))
def test_delayed_frames_leave_at_their_time_in_its_order_and_none_early(delays):
    frames = [frame(SENSOR, 100 - n) for n in range(len(delays))]  # content must not decide the order
    plan = {f.at_ns: delay for f, delay in zip(frames, delays, strict=True)}
    script = Script(becomes=lambda side, f, now_ns: (Planned(now_ns + plan[f.at_ns], f),))
    gateway = core(injector=script)
    gateway.receive("plant", frames, 0)
    left = []
    for now_ns in range(52):
        due = gateway.next_ns()
        assert due is None or due >= now_ns
        gateway.advance(now_ns)
        queue = gateway.waiting("ecu")
        left += [(now_ns, queue.popleft()) for _ in range(len(queue))]
    assert gateway.next_ns() is None
    expected = sorted(range(len(delays)), key=lambda n: (delays[n], n))
    assert left == [(delays[n], frames[n]) for n in expected]


def test_frames_may_be_repeated_and_replaced():
    forged = Frame(SENSOR, bytes(8))
    script = Script(becomes=lambda side, f, now_ns: (Planned(now_ns, f), Planned(now_ns, forged)))
    gateway = core(injector=script)
    gateway.receive("plant", [frame(SENSOR, 1)], 0)
    assert list(gateway.waiting("ecu")) == [frame(SENSOR, 1), forged]


def test_delayed_frames_are_bounded_too():
    script = Script(becomes=lambda side, f, now_ns: (Planned(now_ns + MS, f),))
    gateway = core(injector=script, queue_frames=10)
    gateway.receive("plant", [frame(SENSOR, n) for n in range(25)], 0)
    assert gateway.counts["ecu"].overflowed == 15
    gateway.advance(MS)
    assert len(gateway.waiting("ecu")) == 10


def test_frames_that_nobody_sent_go_onto_the_bus_they_are_meant_for():
    script = Script(unasked=[(5, "ecu", frame(SENSOR)), (9, "plant", frame(STRANGE))])
    gateway = core(injector=script)
    assert gateway.next_ns() == 5
    gateway.advance(5)
    assert list(gateway.waiting("ecu")) == [frame(SENSOR)]
    assert gateway.next_ns() == 9
    gateway.advance(9)
    assert list(gateway.waiting("plant")) == [frame(STRANGE)]
    assert [gateway.counts[side].injected for side in SIDES] == [1, 1]


def test_a_side_that_is_bus_off_neither_hears_nor_speaks_until_it_is_back():
    off, on = Action("bus_off", "ecu"), Action("bus_on", "ecu")
    gateway = core(injector=Script(wanted=[(5, off), (9, on)]))
    gateway.receive("plant", [frame(SENSOR)], 0)
    assert gateway.advance(5) == []
    gateway.receive("plant", [frame(SENSOR)], 6)
    gateway.receive("ecu", [frame(LIMITS)], 6)
    assert not gateway.waiting("ecu")
    assert not gateway.waiting("plant")
    assert gateway.counts["ecu"].silenced == 3
    gateway.advance(9)
    gateway.receive("plant", [frame(SENSOR)], 10)
    assert len(gateway.waiting("ecu")) == 1


def test_what_the_core_cannot_do_is_left_to_the_shell():
    kill = Action("kill", "ecu")
    gateway = core(injector=Script(wanted=[(5, kill)]))
    assert gateway.advance(4) == []
    assert gateway.advance(5) == [kill]
    assert gateway.advance(6) == []


@pytest.mark.parametrize("side", SIDES)
def test_nothing_planned_means_nothing_to_wait_for(side):
    gateway = core()
    gateway.receive(side, [frame(SENSOR)], 0)
    assert gateway.next_ns() is None
