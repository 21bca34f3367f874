"""What is sampled of processes is what /proc said; memory that grows after the first minute is found, whatever came before."""

import os
import subprocess
import sys
from itertools import count
from pathlib import Path

import pytest

from hil.timing.host import HostClock
from hil.timing.vitals import GROWTH_BYTES, Reading, Watch, judge_memory, read, with_children
from hil.verdict import Result

SECOND = 1_000_000_000
MIB = 1 << 20


def watched(resident, *, waited_ns=lambda second: 0, seconds=600, process="ecu"):
    """The one life of a process whose memory and waiting are functions of its age [s]."""
    ages = count()
    watch = Watch(lambda _: Reading(resident(age := next(ages)), waited_ns(age)), lambda: HostClock(0, 0))
    for second in range(seconds + 1):
        watch.sample([(process, 7)], second * SECOND)
    (life,) = watch.vitals().lives
    return life


def test_a_buffer_that_fills_in_the_first_minute_is_flat():
    life = watched(lambda second: 100 * MIB + min(second, 59) * MIB)
    assert (life.start_bytes, life.end_bytes) == (100 * MIB, 159 * MIB)
    assert life.growth_bytes == 0
    assert judge_memory([life]).result is Result.PASSED


@pytest.mark.parametrize(("per_second", "result"), [(1_900, Result.PASSED), (2_000, Result.FAILED)])
def test_growth_is_measured_from_the_first_minute_on(per_second, result):
    """540 s at 1942 byte/s are the permitted MiB."""
    life = watched(lambda second: 100 * MIB + per_second * second)
    assert life.growth_bytes == 540 * per_second
    assert (life.growth_bytes <= GROWTH_BYTES) == (result is Result.PASSED)
    verdict = judge_memory([watched(lambda second: MIB), life])
    assert verdict.result is result
    assert verdict.reason.startswith("ecu grew by") == (result is Result.FAILED)


def test_memory_given_back_at_the_end_was_held_nevertheless():
    life = watched(lambda second: 100 * MIB + (20 * MIB if 300 < second < 500 else 0))
    assert life.end_bytes == life.settled_bytes
    assert life.growth_bytes == 20 * MIB


def test_a_process_that_did_not_live_long_enough_leaves_the_question_open():
    long, short = watched(lambda _: MIB, process="plant"), watched(lambda _: MIB, seconds=119)
    assert judge_memory([long]).result is Result.PASSED
    verdict = judge_memory([long, short])
    assert verdict.result is Result.INCONCLUSIVE
    assert "ecu" in verdict.reason
    assert judge_memory([]).result is Result.INCONCLUSIVE
    assert judge_memory([short, watched(lambda _: MIB)]).result is Result.PASSED  # another life was


def test_waiting_over_the_life_and_in_the_worst_second():
    """Nothing but in second 5, of which it waited 0.4 s."""
    life = watched(lambda _: MIB, waited_ns=lambda second: 400_000_000 * (second >= 5), seconds=10)
    assert life.waited == pytest.approx(0.04)
    assert life.worst_waited == pytest.approx(0.4)


def test_stolen_time_over_the_run_and_in_the_worst_second():
    stolen = [0, 0, 0, 50, 50]
    ticks = count()
    watch = Watch(lambda _: None, lambda: (lambda k: HostClock(200 * k, stolen[k]))(next(ticks)))
    for second in range(1, 5):
        watch.sample([], second * SECOND)
    assert watch.vitals().stolen == pytest.approx(50 / 800)
    assert watch.vitals().worst_stolen == pytest.approx(50 / 200)


def test_the_busiest_second_is_the_one_with_the_least_idle_time():
    busy = [0, 50, 240, 240, 240]  # of 200 ticks a second
    ticks = count()
    watch = Watch(lambda _: None, lambda: (lambda k: HostClock(200 * k, 0, busy[k]))(next(ticks)))
    for second in range(1, 5):
        watch.sample([], second * SECOND)
    assert watch.vitals().most_busy == pytest.approx(190 / 200)


def test_a_process_started_again_has_two_lives():
    watch = Watch(lambda pid: Reading(pid * MIB, 0), lambda: HostClock(0, 0))
    watch.sample([("ecu", 1)], 0)
    watch.sample([("ecu", 2)], SECOND)
    assert [(life.process, life.pid, life.start_bytes) for life in watch.vitals().lives] == [
        ("ecu", 1, MIB),
        ("ecu", 2, 2 * MIB),
    ]


def test_a_real_process_is_read_and_one_that_is_gone_is_not():
    ours = read(os.getpid())
    assert ours is not None
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    assert ours.resident == pytest.approx(int(status["VmRSS"].split()[0]) * 1024, rel=0.05)
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        assert ("us/child", child.pid) in with_children([("us", os.getpid())])
        child.kill()
        os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
        assert read(child.pid) is None  # dead, but its parent has not looked
    finally:
        child.communicate()
    assert read(child.pid) is None
    assert with_children([("gone", child.pid)]) == [("gone", child.pid)]
