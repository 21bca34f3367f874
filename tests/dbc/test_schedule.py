"""When frames go out: at their cycle times, evenly, and complete."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.rows import frames_of
from dbc import loader_database, reference_database
from dbc.database import Database
from dbc.errors import EncodeError
from dbc.schedule import FrameSchedule, phases
from plant.unit import signals

TICK_NS = 10_000_000


@given(st.lists(st.sampled_from([1, 2, 5, 10, 20]), min_size=1, max_size=20).map(sorted))
def test_phases_lie_in_their_cycle_and_spread_the_load(cycles):
    """Cycles that divide one another can be spread to one frame of difference between ticks at most."""
    chosen = phases(cycles)
    assert all(0 <= phase < every for phase, every in zip(chosen, cycles, strict=True))
    if all(b % a == 0 for a, b in pairwise(cycles)):
        span = math.lcm(*cycles)
        load = [
            sum(tick % every == phase for phase, every in zip(chosen, cycles, strict=True))
            for tick in range(span)
        ]
        assert max(load) - min(load) <= 1


@pytest.mark.parametrize(
    ("database", "sender", "messages"),
    [
        (loader_database(), signals.MACHINE, signals.MACHINE_MESSAGES),
        (reference_database(), signals.TEST_RIG, signals.REFERENCE_MESSAGES),
    ],
)
def test_each_message_goes_out_at_its_cycle_time(database, sender, messages):
    schedule = FrameSchedule(database, sender, messages, tick_ns=TICK_NS)
    values = {source: 0.0 for signals in messages.values() for _, source in signals.values()}
    sent: dict[int, list[int]] = {}
    loads = []
    for tick in range(400):
        frames = schedule.frames(tick, values)
        loads.append(len(frames))
        for frame in frames:
            sent.setdefault(frame.can_id, []).append(tick)
    for name in messages:
        codec = database.by_name[name]
        ticks = sent[codec.can_id]
        every = codec.cycle_ns // TICK_NS
        assert {b - a for a, b in pairwise(ticks)} == {every}
        assert ticks[0] < every
    assert max(loads) - min(loads) <= 1


@pytest.mark.parametrize(
    ("database", "sender", "messages"),
    [
        (loader_database(), signals.MACHINE, signals.MACHINE_MESSAGES),  # signed and counted
        (reference_database(), signals.TEST_RIG, signals.REFERENCE_MESSAGES),
    ],
)
def test_ticks_made_together_are_those_made_one_by_one(database, sender, messages):
    """Counters go on from call to call, gaps of ticks included."""
    one_by_one, together = (FrameSchedule(database, sender, messages, tick_ns=TICK_NS) for _ in range(2))
    sources = {source for signals in messages.values() for _, source in signals.values()}
    values = np.random.default_rng(3).normal(0.0, 1.0, (90, len(sources)))
    for ticks in (range(3), range(3, 40), (), (41, 44, *range(60, 90))):
        rows, stamps = values[list(ticks)], [7 * tick for tick in ticks]
        expected = [
            frame for k, tick in enumerate(ticks) for frame in one_by_one.pack(tick, rows[k], stamps[k])
        ]
        assert frames_of(together.pack_many(ticks, rows, stamps)) == expected


def test_ticks_made_together_name_a_value_that_has_no_code():
    schedule = FrameSchedule(
        reference_database(), signals.TEST_RIG, signals.REFERENCE_MESSAGES, tick_ns=TICK_NS
    )
    sources = {s for signals in signals.REFERENCE_MESSAGES.values() for _, s in signals.values()}
    values = np.zeros((20, len(sources)))
    values[13] = math.nan
    with pytest.raises(EncodeError, match="nan"):
        schedule.pack_many(range(20), values, [0] * 20)


def test_a_message_the_plant_does_not_make_or_the_dbc_does_not_have_is_refused():
    without = {name: signals for name, signals in signals.MACHINE_MESSAGES.items() if name != "LiftPressure"}
    with pytest.raises(ValueError, match="LiftPressure"):
        FrameSchedule(loader_database(), signals.MACHINE, without, tick_ns=TICK_NS)
    more = {**signals.MACHINE_MESSAGES, "Weather": {}}
    with pytest.raises(ValueError, match="Weather"):
        FrameSchedule(loader_database(), signals.MACHINE, more, tick_ns=TICK_NS)


def test_a_cycle_time_that_is_no_multiple_of_the_tick_is_refused():
    with pytest.raises(ValueError, match="no multiple of the tick"):
        FrameSchedule(loader_database(), signals.MACHINE, signals.MACHINE_MESSAGES, tick_ns=3_000_000)


def test_a_message_longer_than_a_classic_frame_is_refused(tmp_path):
    """Rows would cut it off."""
    file = tmp_path / "long.dbc"
    file.write_text('VERSION ""\nBS_:\nBU_: Us\nBO_ 258 Long: 64 Us\n SG_ X : 0|8@1+ (1,0) [0|255] "" Us\n')
    database = Database.from_file(file, strict=False)
    with pytest.raises(ValueError, match="Long has 64 bytes"):
        FrameSchedule(database, "Us", {"Long": {"X": ("1", "x")}}, tick_ns=TICK_NS)
