"""Lockstep runs without Python's search for reference cycles: there must be none to find, and it comes back."""

import gc

import pytest

from hil.compose import Choice, lockstep
from hil.lockstep import TOGETHER_TICKS, Lockstep
from tests.hil.fakes import FakeEcu, FakePlant


def test_a_tick_leaves_no_reference_cycles():
    """What the collector would find must not grow with the run."""
    found = []
    # the first run is long enough to load all compiled code: reference frames are made TOGETHER_TICKS at a time
    for ticks in (TOGETHER_TICKS + 20, 20, 3 * TOGETHER_TICKS + 20):
        bench = lockstep(Choice(scenario="loaded").load())
        gc.collect()
        gc.disable()
        try:
            for _ in range(ticks):
                bench.step()
            found.append(gc.collect())
        finally:
            gc.enable()
    assert found[1] == found[2]


@pytest.mark.parametrize("collecting", [True, False])
def test_the_collector_is_left_as_it_was_found_however_a_run_ends(collecting):
    (gc.enable if collecting else gc.disable)()
    seen = []

    def interrupt(_):
        seen.append(gc.isenabled())
        raise KeyboardInterrupt

    try:
        with pytest.raises(KeyboardInterrupt):
            Lockstep(FakePlant(20), FakeEcu()).run(interrupt, every=5)
        assert (seen, gc.isenabled()) == ([False], collecting)
    finally:
        gc.enable()
