"""What was late is the host's only if one wait for a processor, there and then, is as long as all that was late beyond the permitted."""

import os
import selectors
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hil.timing.deadlines import Observation, Observer, judge_message
from hil.timing.host import FRESH_NS, LEAST_WAIT_NS, OwnWaits, Sleeps
from hil.timing.measured import Ticks, explain_reactions, explain_ticks
from hil.timing.waits import Wait, explaining, longest_of
from hil.verdict import Result

MS = 1_000_000
PERIOD = 10 * MS
FRAMES = 100
HALF = 50


def rows(*looks):
    return np.array(looks, np.int64).reshape(-1, 3)


def test_a_wait_counts_only_as_far_as_it_may_lie_in_the_time():
    waits = {"hub": rows((0, 10, 8))}
    assert explaining(waits, 5, 30, 5) == Wait("hub", 8, 10)
    assert explaining(waits, 5, 30, 6) is None  # 5 ns of the look are in it
    assert explaining(waits, 0, 10, 8) == Wait("hub", 8, 10)
    assert explaining(waits, 0, 10, 9) is None  # it was not that long
    assert explaining(waits, 10, 30, 1) is None  # over before


def test_the_longest_wait_is_named_and_waits_are_not_added_up():
    waits = {"hub": rows((0, 10, 3), (10, 20, 4)), "plant": rows((0, 20, 6)), "ecu": rows()}
    assert explaining(waits, 0, 20, 2) == Wait("plant", 6, 20)
    assert explaining({"hub": waits["hub"]}, 0, 20, 2) == Wait("hub", 4, 20)
    assert explaining(waits, 0, 20, 7) is None
    assert longest_of(waits) == Wait("plant", 6, 20)
    assert longest_of({"ecu": rows()}) is None


def delayed(by_ms, *, at=HALF):
    """A message whose frame `at` is late by so much; the ones after it keep their times."""
    stamps = np.arange(FRAMES) * PERIOD + 3 * MS
    stamps[at] += round(by_ms * MS)
    return Observation(
        name="Articulation", period_ns=PERIOD, at_ns=np.sort(stamps), counters=np.arange(FRAMES) % 15, sender="Machine"
    )  # fmt: skip


def judged(seen, *looks, node="Machine"):
    observer = Observer(
        start_ns=0, end_ns=FRAMES * PERIOD, waits={node: {"plant": rows(*looks)}} if looks else {}
    )
    return judge_message(seen, observer)


def look_before(by_ms, waited_ms, *, at=HALF):
    """The look of the tick that sends that frame: from the end of the tick before to its own end."""
    due = at * PERIOD + 3 * MS
    return due - PERIOD + MS, due + round(by_ms * MS) + MS, round(waited_ms * MS)


@given(by_ms=st.floats(5.01, 9.9), waited_ms=st.floats(1, 12))
@example(by_ms=7.0, waited_ms=2.0)
@example(by_ms=7.0, waited_ms=1.999)
def test_a_late_frame_is_the_hosts_exactly_if_the_wait_is_as_long_as_what_is_too_much(by_ms, waited_ms):
    """The frame after it comes early by what this one was late: half a period of either is permitted."""
    assert judged(delayed(by_ms)).result is Result.FAILED
    verdict = judged(delayed(by_ms), look_before(by_ms, waited_ms))
    enough = round(waited_ms * MS) >= round(by_ms * MS) - PERIOD // 2
    assert verdict.result is (Result.INCONCLUSIVE if enough else Result.FAILED), verdict.reason
    assert ("plant was kept waiting" in verdict.reason) == enough


def test_the_wait_is_named_with_its_length_and_time():
    reason = judged(delayed(7), look_before(7, 7.2)).reason
    assert "1 late" in reason
    assert reason.endswith("the host was starved for a moment: plant was kept waiting 7.2 ms at 0.51 s")


@pytest.mark.parametrize(("waited_ms", "expected"), [(1.9, Result.FAILED), (2.0, Result.INCONCLUSIVE)])
def test_a_gap_that_nothing_makes_up_for_is_explained_by_itself(waited_ms, expected):
    """From one frame on all are 7 ms later: one gap is 2 ms too long."""
    seen = delayed(0)
    seen.at_ns[HALF:] += 7 * MS
    assert judged(seen, look_before(7, waited_ms)).result is expected


@pytest.mark.parametrize(("waited_ms", "expected"), [(2.8, Result.FAILED), (2.9, Result.INCONCLUSIVE)])
def test_a_frame_too_early_is_explained_by_a_wait_of_the_one_before(waited_ms, expected):
    """One frame is 4.9 ms late, the next 3 ms early: 2.1 ms apart, of which the first explains what it waited."""
    seen = delayed(4.9)
    seen.at_ns[HALF + 1] -= 3 * MS
    verdict = judged(seen, look_before(4.9, waited_ms))
    assert (verdict.late, verdict.early) == (0, 1)
    assert verdict.result is expected


@pytest.mark.parametrize(
    "look",
    [
        look_before(7, 9, at=HALF - 2),  # over before the frame was due
        look_before(7, 9, at=HALF + 2),  # begun when it had come
        look_before(7, 1.9),
    ],
)
def test_a_wait_at_another_time_or_too_short_explains_nothing(look):
    assert judged(delayed(7), look).result is Result.FAILED


def test_the_wait_of_another_node_explains_nothing():
    assert judged(delayed(7), look_before(7, 9), node="EstimatorEcu").result is Result.FAILED


def test_one_wait_does_not_explain_two_late_frames():
    seen = delayed(7)
    seen.at_ns[20] += 7 * MS
    once = look_before(7, 9)
    assert judged(seen, once).result is Result.FAILED
    assert judged(seen, look_before(7, 9, at=20), once).result is Result.INCONCLUSIVE


@pytest.mark.parametrize("wrong", ["jump", "duplicate", "backwards"])
def test_a_wait_explains_no_lost_or_repeated_frame(wrong):
    seen = delayed(7)
    if wrong == "backwards":
        seen.at_ns[70] = seen.at_ns[69] - 1
    else:
        seen.counters[70:] += 1 if wrong == "jump" else -1
        seen.counters[:] %= 15
    looks = [look_before(7, 9, at=at) for at in (HALF, 69, 70, 71)]
    assert judged(seen, *looks).result is Result.FAILED


def test_a_sender_that_skips_ticks_goes_on_later_wherever_in_the_gap_it_waited():
    """A message of 100 ms, put off by five ticks that its sender left out early in the gap: all 50 ms must be the wait."""
    stamps = np.arange(20) * 100 * MS
    stamps[10:] += 55 * MS
    seen = Observation(name="SlopeSensor", period_ns=100 * MS, at_ns=stamps, sender="Machine")
    begin = 9 * 100 * MS
    end_ns = int(stamps[-1])

    def verdict(waited_ms):
        waits = {"Machine": {"plant": rows((begin + 10 * MS, begin + 75 * MS, round(waited_ms * MS)))}}
        return judge_message(seen, Observer(start_ns=0, end_ns=end_ns, waits=waits)).result

    assert verdict(56) is Result.INCONCLUSIVE
    assert verdict(54) is Result.FAILED


@pytest.mark.parametrize(("waited_ms", "expected"), [(50, Result.FAILED), (52, Result.INCONCLUSIVE)])
def test_a_message_of_every_second_tick_waits_for_the_next_that_is_its_own(waited_ms, expected):
    """A wait of six ticks that began between two frames 20 ms apart makes one 61 ms late, of which 10 ms are permitted."""
    stamps = np.arange(20) * 20 * MS
    stamps[10:] += 61 * MS
    begin, end_ns = 9 * 20 * MS, int(stamps[-1])
    seen = Observation(name="Warnings", period_ns=20 * MS, at_ns=stamps, sender="EstimatorEcu")
    waits = {"EstimatorEcu": {"ecu": rows((begin + MS, begin + 70 * MS, waited_ms * MS))}}
    assert judge_message(seen, Observer(start_ns=0, end_ns=end_ns, waits=waits)).result is expected


def ticks(*, late_ms=0.1, took_ms=0.5, skipped=0, at=HALF):
    """Ticks in time but for one, which left out `skipped` before it."""
    due = np.arange(FRAMES) * PERIOD
    due = np.delete(due, np.arange(at - skipped, at)) if skipped else due
    late, took = (np.full(due.size, round(ms * MS)) for ms in (0.1, 0.5))
    late[at - skipped], took[at - skipped] = round(late_ms * MS), round(took_ms * MS)
    return Ticks(due, late, took)


def explained(of, *looks):
    return explain_ticks(of, {"ecu": rows(*looks)})


def tick_look(waited_ms, at=HALF):
    """From the end of the tick before to long after the tick's own."""
    return (at - 1) * PERIOD + MS, at * PERIOD + 30 * MS, round(waited_ms * MS)


@pytest.mark.parametrize(
    ("change", "needed_ms"),
    [
        ({"late_ms": 8.0}, 3.0),
        ({"took_ms": 12.0}, 7.0),
        ({"late_ms": 8.0, "took_ms": 12.0}, 10.0),  # one wait for both
        ({"late_ms": 3.0, "skipped": 2}, 18.0),  # the first of them was due 23 ms before this one started
    ],
)
def test_a_tick_is_explained_by_a_wait_as_long_as_all_that_it_took_too_much(change, needed_ms):
    of = ticks(**change)
    k = HALF - change.get("skipped", 0)
    for waited_ms, enough in ((needed_ms, True), (needed_ms - 0.01, False)):
        found = explained(of, tick_look(waited_ms, k))
        assert found.by_wait.tolist() == [enough and n == k for n in range(of.due_ns.size)]
        assert (found.longest is not None) == enough
        assert found.skipped.sum() == change.get("skipped", 0)
    assert not explained(of).by_wait.any()
    assert not explained(of, tick_look(90, at=HALF - 8)).by_wait.any()


def test_an_explained_tick_counts_as_what_is_permitted_and_the_others_as_they_are():
    of = ticks(late_ms=8.0, took_ms=12.0)
    found = explained(of, tick_look(20))
    assert (found.lateness_ns[HALF], found.execution_ns[HALF]) == (5 * MS, 5 * MS)
    others = np.arange(FRAMES) != HALF
    assert np.array_equal(found.lateness_ns[others], of.lateness_ns[others])


def test_ticks_of_another_life_are_not_skipped_ones():
    due = np.concatenate((np.arange(10) * PERIOD, 3_001 * MS + 1 + np.arange(10) * PERIOD))
    found = explain_ticks(Ticks(due, np.full(20, MS), np.full(20, MS)), {})
    assert found.skipped.sum() == 0


def test_a_reaction_is_explained_by_a_wait_as_long_as_all_beyond_two_periods():
    begins, took = np.array([0, 10 * MS, 20 * MS]), np.array([6 * MS, 26 * MS, 25 * MS])
    own, wait = explain_reactions(begins, took, {"ecu": rows((9 * MS, 36 * MS, 6 * MS))})
    assert own.tolist() == [6 * MS, 20 * MS, 20 * MS]
    assert wait == Wait("ecu", 6 * MS, 36 * MS)
    own, wait = explain_reactions(begins, took, {"ecu": rows((9 * MS, 36 * MS, 4 * MS))})
    assert own.tolist() == took.tolist()
    assert wait is None


def test_only_waits_worth_it_are_reported(tmp_path):
    file = tmp_path / "schedstat"
    reported = []

    def look(now_ns, waited_ns):
        file.write_text(f"123 {waited_ns} 7\n")
        waits.look(now_ns)

    file.write_text("123 5000000 7\n")
    with closing(OwnWaits(lambda *row: reported.append(row), file=file)) as waits:
        look(100, 5_000_000 + LEAST_WAIT_NS - 1)
        look(200, 5_000_000 + 2 * LEAST_WAIT_NS - 1)
        look(300, 5_000_000 + 9 * LEAST_WAIT_NS)
    assert reported == [(100, 200, LEAST_WAIT_NS), (200, 300, 7 * LEAST_WAIT_NS + 1)]


def test_a_kernel_without_the_statistics_reports_no_wait(tmp_path):
    with closing(OwnWaits(lambda *_: pytest.fail("a wait was reported"), file=tmp_path / "none")) as waits:
        waits.look(1)


SPIN = """
import os, sys, time
from hil.timing.host import OwnWaits
rows = []
begun = time.monotonic_ns()
waits = OwnWaits(lambda *row: rows.append(row))
used = time.process_time_ns()
while len(rows) < 3 and time.monotonic_ns() < begun + 60_000_000_000:
    waits.look(time.monotonic_ns())
used = time.process_time_ns() - used
print(len(rows), sum(row[2] for row in rows), time.monotonic_ns() - begun - used)
"""


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the kernel does not say who waited")
def test_a_process_that_shares_its_processor_reports_its_waits():
    """They are no longer than the time in which it neither ran nor slept, which is what they are made of."""
    one = {min(os.sched_getaffinity(0))}
    hog = subprocess.Popen(
        [sys.executable, "-c", "while True: pass"], preexec_fn=lambda: os.sched_setaffinity(0, one)
    )
    try:
        spun = subprocess.run(
            [sys.executable, "-c", SPIN],
            preexec_fn=lambda: os.sched_setaffinity(0, one),
            capture_output=True,
            text=True,
            check=True,
        )
    finally:
        hog.kill()
        hog.wait()
    count, waited_ns, idle_ns = map(int, spun.stdout.split())
    assert count >= 3
    assert 3 * LEAST_WAIT_NS <= waited_ns <= idle_ns + LEAST_WAIT_NS  # two clocks


def test_a_look_costs_a_tiny_share_of_a_period():
    """Ten thousand looks in less than a second of processor time: 100 us each, a hundredth of a period."""
    with closing(OwnWaits(lambda *_: None)) as waits:
        begun = time.process_time()
        for now_ns in range(10_000):
            waits.look(now_ns)
        assert time.process_time() - begun < 1.0


def test_a_process_that_slept_when_its_tick_was_due_was_woken_late_by_the_host(tmp_path: Path) -> None:
    """And one that was awake then, or only looked whether something was there, was not."""
    reader, writer = os.pipe()
    file = tmp_path / "schedstat"
    file.write_text("0 0 0")
    reported: list[tuple[int, ...]] = []
    with Sleeps() as sleeps, closing(OwnWaits(lambda *row: reported.append(row), sleeps, file=file)) as waits:
        sleeps.register(reader, selectors.EVENT_READ)
        due_ns = time.monotonic_ns() + 1_000_000
        sleeps.select(0.02)  # the timer ought to have woken it after 1 ms
        sleeps.select(0.0)
        woken_ns = time.monotonic_ns()
        waits.look(woken_ns, due_ns)
        assert len(reported) == 1
        assert 15_000_000 < reported[0][2] <= woken_ns - due_ns
        os.write(writer, b".")
        sleeps.select(0.02)
        due_ns = time.monotonic_ns() + 1_000_000
        while time.monotonic_ns() < due_ns + 5_000_000:  # it computes
            pass
        sleeps.select(0.02)
        waits.look(time.monotonic_ns(), due_ns)
        assert len(reported) == 1
    os.close(reader)
    os.close(writer)


class Machine:
    """A virtual machine whose hypervisor takes time, as the two files of the kernel show it."""

    def __init__(self, folder: Path) -> None:
        self._schedstat, self._stat = folder / "schedstat", folder / "stat"
        self.reported: list[tuple[int, ...]] = []
        self.waited_ns, self.stolen = 0, 40
        self._write()
        self.waits = OwnWaits(lambda *row: self.reported.append(row), file=self._schedstat, host=self._stat)

    def _write(self) -> None:
        self._schedstat.write_text(f"0 {self.waited_ns} 0")
        self._stat.write_text(f"cpu  9 9 9 9 9 9 9 {self.stolen} 0 0\n")

    def tick(self, due_ms: int, ends_ms: int) -> None:
        self._write()
        self.waits.look(ends_ms * MS, due_ms * MS)


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    machine = Machine(tmp_path)
    machine.tick(10, 11)
    yield machine
    machine.waits.close()


def test_a_late_tick_is_the_hypervisors_as_far_as_it_took_time(machine: Machine) -> None:
    machine.tick(20, 31)  # the kernel has not counted yet
    machine.stolen += 2
    assert machine.reported == []
    machine.tick(30, 32)
    assert machine.reported == [(11 * MS, 31 * MS, 11 * MS)]  # 20 ms were taken, but only 11 passed
    machine.tick(40, 41)
    machine.tick(50, 65)
    machine.stolen += 1
    machine.tick(60, 66)
    assert machine.reported[1:] == [(41 * MS, 65 * MS, 10 * MS)]


def test_a_tick_that_is_late_by_itself_stays_so(machine: Machine) -> None:
    machine.tick(20, 31)
    machine.tick(30, 32)
    machine.stolen += 3  # later, in the ticks that were in time
    machine.tick(40, 41)
    machine.tick(50, 51)
    assert machine.reported == []


def test_what_was_taken_long_before_excuses_nothing(machine: Machine) -> None:
    machine.stolen += 5
    begin = 10 + FRESH_NS // MS
    machine.tick(begin, begin + 1)
    machine.tick(begin + 10, begin + 25)
    machine.tick(begin + 20, begin + 26)
    assert machine.reported == []


def test_a_wait_for_a_processor_is_not_counted_twice(machine: Machine) -> None:
    machine.waited_ns += 8 * MS
    machine.stolen += 1
    machine.tick(20, 31)
    machine.tick(30, 32)
    assert machine.reported == [(11 * MS, 31 * MS, 8 * MS)]
