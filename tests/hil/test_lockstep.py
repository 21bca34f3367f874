"""Order, latency and completeness of the lockstep loop, with cores small enough to predict."""

import itertools
from functools import partial

import numpy as np
import pytest

from bus.row_wire import RowWire
from bus.rows import SENT, columns_of, frames_of
from bus.wire import Wire
from hil import lockstep
from hil.lockstep import ECU_PHASE_NS, PERIOD_NS, Lockstep
from tests.bus.rows import table_of
from tests.hil.fakes import ANSWER, SENSOR, SPEEDS, FakeEcu, FakePlant


def run(ticks=20):
    plant, ecu = FakePlant(ticks), FakeEcu()
    return plant, ecu, Lockstep(plant, ecu).run()


def test_the_ecu_tick_of_a_period_knows_that_periods_sensor_frames():
    _, _, recording = run()
    answers = [f.data for f in recording.bus if f.can_id == ANSWER]
    assert answers == [n.to_bytes(8, "little") for n in range(20)]


def test_the_answer_arrives_before_the_next_plant_tick():
    plant, _, _ = run()
    for number, (_, now_ns) in enumerate(plant.heard):
        assert number * PERIOD_NS + ECU_PHASE_NS < now_ns <= (number + 1) * PERIOD_NS


def test_ticks_are_exactly_periodic():
    plant, ecu, _ = run()
    assert plant.ticked == [n * PERIOD_NS for n in range(20)]
    assert ecu.ticked == [n * PERIOD_NS + ECU_PHASE_NS for n in range(20)]


def test_nobody_hears_what_it_sent_itself_and_everybody_hears_the_rest():
    plant, ecu, recording = run()
    assert {f.can_id for f, _ in plant.heard} == {ANSWER}
    assert {f.can_id for f, _ in ecu.heard} == {SENSOR, SPEEDS}
    assert len(recording.bus) == len(plant.heard) + len(ecu.heard)


def test_stamps_increase_strictly_and_are_those_that_the_receiver_was_given():
    plant, ecu, recording = run()
    stamps = [f.at_ns for f in recording.bus]
    assert all(a < b for a, b in itertools.pairwise(stamps))
    assert all(frame.at_ns == now_ns for frame, now_ns in plant.heard + ecu.heard)


def test_truth_and_reference_are_recorded_once_per_tick():
    _, _, recording = run()
    assert [t.time_s for t in recording.truth] == [n * PERIOD_NS * 1e-9 for n in range(20)]
    assert [f.at_ns for f in recording.reference] == [n * PERIOD_NS for n in range(20)]


@pytest.mark.parametrize(("together", "ticks"), [(1, 20), (7, 20), (20, 20), (100, 20)])
def test_reference_frames_made_together_are_complete_and_in_order(together, ticks, monkeypatch):
    monkeypatch.setattr(lockstep, "TOGETHER_TICKS", together)
    recording = run(ticks)[2]
    assert [int.from_bytes(f.data, "little") for f in recording.reference] == list(range(ticks))
    assert [f.at_ns for f in recording.reference] == [n * PERIOD_NS for n in range(ticks)]


def test_an_interrupted_run_has_the_reference_frames_of_every_tick_with_a_truth():
    class Interrupted(FakePlant):
        """Ended by Ctrl-C after the tick, before what was true then is known."""

        def tick(self, now_ns):
            frames = super().tick(now_ns)
            if len(self.ticked) == 9:
                raise KeyboardInterrupt
            return frames

    bench = Lockstep(Interrupted(20), FakeEcu())
    with pytest.raises(KeyboardInterrupt):
        bench.run()
    assert [f.at_ns for f in bench.recording.reference] == [n * PERIOD_NS for n in range(8)]


def test_a_recording_taken_in_parts_is_the_whole():
    bench, parts = Lockstep(FakePlant(20), FakeEcu()), []
    for ticks in (1, 7, 0, 12):
        for _ in range(ticks):
            bench.step()
        parts.append(bench.take())
    whole = run()[2]
    for kept in ("bus", "reference", "truth", "ecu_findings"):
        assert [one for part in parts for one in getattr(part, kept)] == getattr(whole, kept), kept
    assert bench.recording.truth == []


def test_the_reference_can_be_left_out():
    assert Lockstep(FakePlant(3), FakeEcu(), reference=False).run().reference == []


def test_findings_of_both_sides_are_kept():
    _, _, recording = run(3)
    assert recording.ecu_findings == ["heard", "heard", "ticked"] * 3
    assert recording.plant_findings == []


def test_two_runs_are_equal():
    assert run()[2] == run()[2]


def test_progress_hears_simulated_time():
    heard = []
    Lockstep(FakePlant(20), FakeEcu()).run(heard.append, every=5)
    assert heard == pytest.approx([0.05, 0.10, 0.15, 0.20])


class RowPlant(FakePlant):
    """The same frames as rows."""

    wanted = frozenset({ANSWER})

    def tick_rows(self, now_ns):
        frames = self.tick(now_ns)
        return columns_of(table_of(frames)), len(frames)

    def reference_rows(self, truths, first, at_ns):
        return table_of(self.reference_of(truths, first, at_ns))


class RowEcu(FakeEcu):
    """Takes the frames of a cycle in one call, as rows."""

    def cycle_rows(self, received, now_ns):
        found = [finding for frame in frames_of(received) for finding in self.receive(frame, frame.at_ns)]
        tick = self.tick(now_ns)
        table = table_of(tick.frames, np.zeros(9, SENT))
        return columns_of(table), len(tick.frames), [*found, *tick.findings]


def test_sides_that_give_and_take_rows_leave_the_same_run():
    plant, ecu = RowPlant(20), RowEcu()
    one, other, expected = run()
    assert Lockstep(plant, ecu).run() == expected
    assert (plant.heard, plant.ticked, ecu.heard, ecu.ticked) == (
        one.heard,
        one.ticked,
        other.heard,
        other.ticked,
    )


def test_frames_after_the_last_cycle_have_their_findings_also_when_a_run_is_interrupted(monkeypatch):
    def interrupt(_):
        raise KeyboardInterrupt

    slow = 45_000  # the second frame of a tick comes after the cycle
    monkeypatch.setattr(lockstep, "RowWire", partial(RowWire, bit_rate=slow))
    recordings = []
    for bench in (
        Lockstep(FakePlant(20), FakeEcu(), wire=Wire(bit_rate=slow)),
        Lockstep(RowPlant(20), RowEcu()),
    ):
        with pytest.raises(KeyboardInterrupt):
            bench.run(interrupt, every=7)
        recordings.append(bench.recording)
    assert recordings[0] == recordings[1]
    assert recordings[0].ecu_findings[-1] == "heard"
