"""Replay: every frame at its own time and none left out; and one line however it ends."""

import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import ERROR, Frame
from dbc.errors import LogError
from dbc.recordings.logfile import parse_candump
from dbc.recordings.writer import candump_line
from hil.ending import Ending
from hil.replay.command import ReplayError, targets
from hil.replay.replay import RETRY_NS, TURN, Player, due_ns
from studies.campaigns.memory import table_of
from tests.bus.hub.running import RunningHub
from tests.bus.laws import WAIT_S, collect, unstamped

MS = 1_000_000


class Bus:
    """Remembers what was sent and when; refuses the next `refuse` frames."""

    def __init__(self, clock):
        self.clock, self.sent, self.refuse = clock, [], 0

    def send(self, frame):
        if self.refuse:
            self.refuse -= 1
            return False
        self.sent.append((self.clock.now, frame))
        return True


class Clock:
    """Virtual time; `late` is added to every wake-up."""

    def __init__(self, now=10**12, late=0):
        self.now, self.late = now, late

    def run(self, player, rounds=10**6):
        """Ask the player until it has finished, or so often."""
        for _ in range(rounds):
            wake = player.advance(self.now)
            if wake is None:
                return True
            self.now = max(self.now, wake + self.late) if wake > self.now else self.now
        return False


def frames(stamps):
    return [Frame(0x100 + k, k.to_bytes(4, "big"), at) for k, at in enumerate(stamps)]


@given(
    st.lists(st.integers(0, 50 * MS), min_size=1, max_size=40),
    st.sampled_from([0.5, 1.0, 4.0]),
    st.integers(0, 20 * MS),
)
def test_each_frame_goes_out_at_its_time_and_lateness_never_adds_up(gaps, speed, late):
    stamps = (np.cumsum(gaps) + 7 * MS).tolist()
    clock = Clock(late=late)
    bus, start = Bus(clock), clock.now
    player = Player(table_of(frames(stamps)), {"loader": bus}, start, speed=speed)
    assert clock.run(player)
    assert [frame.data for _, frame in bus.sent] == [frame.data for frame in frames(stamps)]
    for (at, _), stamp in zip(bus.sent, stamps, strict=True):
        due = start + round((stamp - stamps[0]) / speed)
        assert due <= at <= due + late
    assert player.progress.largest_late_ns <= late


def test_a_refused_frame_is_offered_again_and_the_order_kept():
    clock = Clock()
    bus = Bus(clock)
    bus.refuse = 3
    player = Player(table_of(frames([0, MS, 2 * MS])), {"loader": bus}, clock.now)
    start = clock.now
    assert clock.run(player)
    assert [frame.can_id for _, frame in bus.sent] == [0x100, 0x101, 0x102]
    assert bus.sent[0][0] == start + 3 * RETRY_NS
    assert player.progress.refused == 3


def test_fast_sends_everything_in_turns():
    clock = Clock()
    bus = Bus(clock)
    player = Player(table_of(frames(range(0, 1000 * MS, MS))), {"loader": bus}, clock.now, speed=None)
    start, turns = clock.now, 0
    while player.advance(clock.now) is not None:
        turns += 1
    assert len(bus.sent) == 1000
    assert turns == 1000 // TURN
    assert {at for at, _ in bus.sent} == {start}


def test_a_loop_goes_on_in_the_recorded_rhythm():
    clock = Clock()
    bus, start = Bus(clock), clock.now
    player = Player(table_of(frames([0, 10 * MS, 20 * MS])), {"loader": bus}, start, loop=True)
    assert not clock.run(player, rounds=20)
    assert [at - start for at, _ in bus.sent[:9]] == [k * 10 * MS for k in range(9)]


def test_stamps_that_run_backwards_do_not_hold_anything_up():
    assert due_ns(np.array([5, 9, 7, 12]), 1.0).tolist() == [0, 4, 4, 7]


def test_channels_go_to_their_buses_and_error_frames_nowhere():
    clock = Clock()
    front, rear = Bus(clock), Bus(clock)
    table = table_of([*frames([0, 1, 2, 3]), Frame(ERROR | 4, bytes(8), 4)])
    table = replace(table, channel=np.uint8([0, 1, 2, 1, 0]), channels=("front", "rear", "other"))
    player = Player(table, {"front": front, "rear": rear}, clock.now, speed=None)
    assert clock.run(player)
    assert [frame.can_id for _, frame in front.sent] == [0x100]
    assert [frame.can_id for _, frame in rear.sent] == [0x101, 0x103]


class TestTargets:
    table = replace(table_of(frames([0, 1])), channel=np.uint8([0, 1]), channels=("front", "rear"))

    def test_each_channel_its_bus_or_one_for_the_chosen(self):
        assert targets(["front=hub:/a", "rear=hub:/b=c"], self.table, None, "x.log") == {
            "front": "hub:/a",
            "rear": "hub:/b=c",
        }
        assert targets(["hub:/a"], self.table, "rear", "x.log") == {"rear": "hub:/a"}
        assert targets(["hub:/a"], table_of(frames([0])), None, "x.log") == {"loader": "hub:/a"}

    @pytest.mark.parametrize(
        ("words", "channel", "named"),
        [
            (["hub:/a"], None, "has the channels front, rear"),
            (["hub:/a", "hub:/b"], None, "give each channel its bus as CHANNEL=ADDRESS"),
            (["side=hub:/a"], None, "no channel 'side'; there are front, rear"),
            (["hub:/a"], "side", "no channel 'side'"),
        ],
    )
    def test_what_is_unclear_is_one_clear_error(self, words, channel, named):
        with pytest.raises((ReplayError, LogError), match=named):
            targets(words, self.table, channel, "x.log")


@pytest.fixture
def hub(tmp_path):
    running = RunningHub(str(tmp_path / "hub"))
    yield running
    running.stop()


def started(*words):
    return subprocess.Popen(
        [sys.executable, "-m", "loaderhil", "replay", *map(str, words)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.mark.processes
def test_onto_a_hub_and_a_loop_ends_with_ctrl_c(hub, tmp_path):
    log = tmp_path / "drive.log"
    sent = frames([1000 * MS + k * 5 * MS for k in range(60)])
    log.write_text("".join(f"{candump_line(frame, 'can0')}\n" for frame in sent))
    with hub.connect() as listener:
        process = started(log, f"hub:{hub.path}")
        heard = collect(listener, 60)
        out, errors = process.communicate(timeout=WAIT_S)
        assert (process.returncode, errors) == (Ending.PASSED, "")
        assert "60 frames sent in" in out
        assert unstamped(heard) == unstamped(list(parse_candump(log.read_bytes()).frames()))
        span = heard[-1].at_ns - heard[0].at_ns
        assert span >= 0.9 * 59 * 5 * MS  # never faster than recorded, whatever the host does
        process = started(log, f"hub:{hub.path}", "--loop", "--fast")
        collect(listener, 130)
        process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + WAIT_S
        while process.poll() is None and time.monotonic() < deadline:
            listener.drain()
        out, errors = process.communicate(timeout=WAIT_S)
        assert (process.returncode, errors) == (Ending.INTERRUPTED, "")
        assert "rounds" in out
