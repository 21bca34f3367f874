"""The shortest drive programme: laws on known information, and one programme of the bench."""

from types import SimpleNamespace

import numpy as np
import pytest

from identify.machine.balances import JointPrior
from identify.machine.coordinates import Coordinates
from identify.machine.drives import identified
from identify.machine.programme import LONGEST, Drive, drives, shortest
from tests.identify.test_drives import HANDS_OFF, MACHINE, build, make_run, read, truth_of

NAMES = ("a", "b", "c")


def known(*, prior=None, inflation=(1.0, 1.0, 1.0)):
    """An identification whose drives have shown nothing of three parameters with priors of 1."""
    return SimpleNamespace(
        names=NAMES,
        coordinates=Coordinates(prior),
        priors=dict.fromkeys(NAMES, (0.0, 1.0)),
        inflation=np.array(inflation),
        fit=SimpleNamespace(information=np.eye(3)),
    )


def drive(name, duration_s, *information):
    return Drive(name, duration_s, np.diag(np.array(information, float)))


def test_the_cheapest_of_all_programmes_is_taken():
    """Two short drives beat a long one that shows everything; a greedy choice by information would take the long one."""
    found = shortest(known(), [drive("all", 50, 9, 9, 9), drive("ab", 20, 9, 9, 0), drive("c", 20, 0, 0, 9)])
    assert {s.drive.name for s in found.steps} == {"ab", "c"}
    assert found.duration_s == 40
    assert found.beyond == []


def test_what_no_programme_determines_is_listed_and_costs_no_drive():
    found = shortest(known(), [drive("ab", 20, 9, 9, 0), drive("c", 20, 0, 0, 0.1)])
    assert [s.drive.name for s in found.steps] == ["ab"]
    assert found.beyond == ["c"]


def test_a_drive_is_repeated_where_one_is_not_enough():
    """Half of the prior needs an information of 3 beside the prior's 1: two drives of 1.6."""
    found = shortest(known(), [drive("all", 10, 1.6, 9, 9)])
    assert [s.drive.name for s in found.steps] == ["all", "all"]
    assert found.steps[0].remaining["a"] == pytest.approx(1.0 / np.sqrt(2.6))
    assert found.steps[1].remaining["a"] == pytest.approx(1.0 / np.sqrt(4.2))


def test_the_most_informative_drive_comes_first_and_no_step_loses():
    found = shortest(known(), [drive("c", 1, 0, 0, 4), drive("ab", 2, 9, 9, 0)])
    assert [s.drive.name for s in found.steps] == ["ab", "c"]
    left = np.array([list(found.now.values()), *(list(s.remaining.values()) for s in found.steps)])
    assert np.all(np.diff(left, axis=0) <= 1e-12)
    assert np.all(left[-1] <= 0.5)


def test_nothing_open_needs_no_drive():
    done = known()
    done.fit.information = 9.0 * np.eye(3)
    found = shortest(done, [drive("all", 10, 9, 9, 9)])
    assert found.now == {}
    assert list(found.steps) == []


def test_disagreement_of_blocks_is_not_healed_by_drives():
    """A variance that blocks of time inflate ninefold needs nine times the information."""
    found = shortest(known(inflation=(9.0, 1.0, 1.0)), [drive("all", 10, 12, 12, 12)])
    assert len(found.steps) == 3
    assert len(found.steps) <= LONGEST


def test_parameters_that_weighings_tie_are_judged_in_their_own_units():
    """With a joint prior of correlation 0.99, determining one parameter determines the other."""
    covariance = np.array([[1.0, 0.99, 0.0], [0.99, 1.0, 0.0], [0.0, 0.0, 1.0]])
    prior = JointPrior(NAMES, np.zeros(3), covariance)
    back = np.linalg.cholesky(covariance)
    about_a = Drive("a", 10, back.T @ np.diag([30.0, 0.0, 0.0]) @ back)
    found = shortest(known(prior=prior), [about_a])
    left = found.steps[-1].remaining
    assert left["b"] == pytest.approx(np.sqrt(1.0 - 0.99**2 + 0.99**2 / 31.0), rel=1e-6)
    assert found.beyond == ["c"]


@pytest.mark.slow
def test_the_bench_says_which_drive_shows_yaw_inertia_after_a_straight_drive(tmp_path):
    """Of a straight drive yaw inertia is open; the programme has turns, and keeps its promise when it is driven."""
    truth = truth_of()
    straight = read(make_run(tmp_path / "straight", "unloaded", 81, build([]), truth, more=HANDS_OFF))
    found = identified(MACHINE, build, [straight])
    (tmp_path / "l60.toml").write_text('base = "l60"\n', encoding="utf-8")
    candidates, left_out = drives(found, tmp_path / "l60.toml", lambda _: None)
    assert {d.name for d in candidates} >= {"unloaded", "hard_braking", "transient_articulation"}
    assert {text.partition(":")[0] for text in left_out} == {"pile_entry", "wheel_lock"}
    programme = shortest(found, candidates, left_out)
    assert programme.now["rear_yaw_inertia"] > 0.9
    assert "rear_yaw_inertia" not in programme.beyond
    driven = [
        read(make_run(tmp_path / f"more{i}", s.drive.name, 90 + i, build([]), truth))
        for i, s in enumerate(programme.steps)
    ]
    after = {
        e.quantity.parameter: e.remaining for e in identified(MACHINE, build, [straight, *driven]).estimates
    }
    promised = programme.steps[-1].remaining
    assert after["rear_yaw_inertia"] < 0.2
    for name in ("rear_yaw_inertia", "rear_height", "rear_x", "wheel_spin"):
        if name in promised:
            # the noise of turns is not that of braking; a promise that is wrong by a factor would be of no use
            assert after[name] < 2.0 * promised[name] + 0.02, name
