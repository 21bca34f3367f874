"""The claims of docs/thesis/pile-entry.md, against the facts the thesis reports and the statics of a fifth contact."""

import numpy as np
import pytest

from studies.thesis.pile_entry import LIFTING, MOVES_S, PILE, ROLLING, TITLES, measure, pile
from studies.thesis.split import SPLITS


@pytest.fixture(scope="module")
def runs():
    return {case: measure(case) for case in TITLES}


@pytest.mark.parametrize("case", TITLES)
def test_the_piles_force_is_what_the_wheels_show(runs, case):
    """The sum of the loads rises by what weighs on the edge, once the machine digs evenly: 30 % of 45 kN."""
    run = runs[case]
    before, now = run.truth["time_s"] < 1.5, run.truth["time_s"] > 5.0
    total = run.truth["normal_force"].sum(axis=1)
    more = total[now].mean() - total[before].mean()
    assert more == pytest.approx(PILE["most_N"] * PILE["weight_share"], rel=0.05)
    assert pile().named["most_N"] == PILE["most_N"]


def test_the_pressure_that_looks_like_the_load_is_another_in_each_entry(runs):
    lifting, rolling = runs[LIFTING], runs[ROLLING]
    assert lifting.alike("lift_pressure") > lifting.alike("tilt_pressure") + 0.1
    assert rolling.alike("tilt_pressure") > rolling.alike("lift_pressure") + 0.1


@pytest.mark.parametrize("case", TITLES)
def test_printed_it_does_not_see_the_pile(runs, case):
    run = runs[case]
    late = run.truth["time_s"] > MOVES_S
    assert np.ptp(run.true) > 18e3
    assert run.front["printed"][late].mean() == pytest.approx(run.true[0], abs=5e3)
    assert run.rms("printed") > 12e3


@pytest.mark.parametrize("case", TITLES)
def test_one_pressure_alone_is_not_enough_and_both_are(runs, case):
    run = runs[case]
    assert run.rms("lift pressure") > run.rms("printed")
    assert run.rms("tilt pressure") > 5e3
    assert run.rms("corrected") < 0.08 * run.rms("printed")


@pytest.mark.parametrize("split", [SPLITS[4], SPLITS[8]], ids=str)
def test_whatever_the_split(split):
    run = measure(ROLLING, split)
    assert run.rms("corrected") < 0.12 * run.rms("printed")
