"""The benchmark of faults that come and go: its drives, and how it counts."""

import numpy as np
import pytest

from bench.proof.straight_truth import WHITE, record
from bench.switched import DURATION_S, LONGEST_S, SHORTEST_S, Case, Fault, page, spells
from discrepancy.signals.recording import Recording


@pytest.mark.parametrize("seed", range(20))
def test_intervals_lie_apart_and_within_the_drive(seed: int) -> None:
    found = spells(np.random.default_rng(seed))
    assert all(SHORTEST_S <= end - start <= LONGEST_S for start, end in found)
    ends = [0.0, *(t for spell in found for t in spell), DURATION_S]
    gaps = np.diff(ends)[::2]
    assert np.all(gaps >= 20.0 - 1e-9)


def test_the_overlap_is_intersection_over_union_in_seconds() -> None:
    true = [(20.0, 60.0), (100.0, 140.0)]
    assert Fault("slope", true, named=True, reported=true).overlap == 1.0
    # 40 of 80 s found, and 20 s more
    assert Fault("slope", true, named=True, reported=[(40.0, 80.0), (100.0, 120.0)]).overlap == pytest.approx(
        0.4
    )
    assert Fault("slope", true, named=False, reported=true).overlap == 0.0


def test_an_effect_acts_in_its_own_intervals_alone() -> None:
    """Rolling resistance takes g c_rr from the acceleration the moment it sets in; before that nothing differs, although a slope acts elsewhere."""
    coefficient, drive = 0.02, {"mass": 12_000.0, "viscous": 400.0}

    def driven(start_s: float, **effects: float) -> Recording:
        times = {"rolling": [(start_s, start_s + 10.0)], "slope": [(100.0, 110.0)]}
        rng = np.random.default_rng(1)
        return record({**drive, **effects}, WHITE, rng, duration_s=120.0, intervals=times)

    without = driven(20.0, slope=0.03)
    speed = without.signals["speed"]
    start_s = float(speed.time_s[np.flatnonzero((speed.time_s > 20.0) & (speed.value > 1.0))[0]])
    rolls = driven(start_s, slope=0.03, rolling=coefficient)
    moved = rolls.signals["acceleration"].value - without.signals["acceleration"].value
    at = int(np.searchsorted(without.signals["acceleration"].time_s, start_s - 1e-9))
    assert np.max(np.abs(moved[:at])) == 0.0
    assert moved[at] == pytest.approx(-9.81 * coefficient, rel=0.02)


def test_the_page_counts_faults_and_false_names() -> None:
    found = Fault("slope", [(20.0, 60.0)], named=True, reported=[(20.0, 60.0)])
    missed = Fault("drive loss", [(80.0, 130.0)], named=False, reported=[])
    text = "\n".join(page([Case(7, (found, missed), ("brake fade",), "explained")], "command", "abc"))
    assert "| faults in a named group | >= 85% | 1 of 2 " in text
    assert "**missed**" in text
    assert "| 7 | slope | 20 to 60 | 20 to 60 | 1.00 | brake fade | explained |" in text
    assert "| 7 | drive loss | 80 to 130 | not named | 0.00 |" in text
