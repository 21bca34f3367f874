"""The wild arms: differences that are really there, names that are fair, twins, and the page's counts."""

from dataclasses import replace

import numpy as np
import pytest

from bench import wild as page
from bench.proof import wild, wild_loader
from bench.proof.arm import Arm, Done, Truth
from bench.proof.difference import AT_ONCE, Difference
from discrepancy.estimation.problem import Problem
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Recording, signal
from tests.diagnosis.cases import finding

NAMES = list(wild.BODIES)
ALL = [*NAMES, wild_loader.BODY]


def done(kind: str, what: str, *found, effects=(), body="wild straight") -> Done:
    arm = Arm(body=body, kind=kind, seed=1, effects=effects, what=what, strength=250.0 if effects else 0.0)
    findings = Findings(model="m", recordings=["r"], status="explained", reasons=[], findings=list(found))
    return Done(arm, Truth(reached=250.0), findings, 1.0)


def named(effect: str, *group: str):
    return finding(effect, "physics", {effect: 1.0}, group=group)


@pytest.mark.parametrize("name", ALL)
def test_tuning_and_report_share_no_arm(name: str) -> None:
    plans = [{arm.key for arm in wild.arms(name, first)} for first in wild.SEEDS.values()]
    assert not plans[0] & plans[1]
    for plan in plans:
        assert abs(len(plan) - (60 if name == wild_loader.BODY else 200)) <= 20


@pytest.mark.parametrize("name", ALL)
def test_no_difference_of_an_arm_is_nearly_what_is_hidden(name: str) -> None:
    for arm in wild.arms(name, wild.SEEDS["tuning"]):
        differences = wild.differences(arm)
        assert len(differences) == (0 if arm.kind == "twin" else AT_ONCE)
        assert not {f for d in differences for f in d.fair} & set(arm.effects)


@pytest.mark.parametrize(
    ("name", "difference"), [(n, d) for n, b in wild.BODIES.items() for d in wild.DIFFERENCES_OF[n]]
)
def test_every_difference_moves_what_is_recorded(name: str, difference: Difference) -> None:
    """On the same drive, with the same noise; a difference that does nothing would test nothing."""
    body = wild.BODIES[name]
    arm = Arm(body=body.name, kind="null", seed=7, noise="white")
    values = {key: high for key, (_, high) in difference.ranges.items()}
    # a drag of another power needs a drag
    without = {"drag_coefficient": values["drag_coefficient"]} if "drag_coefficient" in values else {}
    tame, spoilt = (body.record(v, arm, np.random.default_rng(7))[0] for v in (without, values))
    moved = [
        not np.array_equal(a.value, b.value) or not np.array_equal(a.time_s, b.time_s)
        for a, b in ((tame.signals[n], spoilt.signals[n]) for n in tame.signals)
    ]
    assert any(moved)
    assert all(np.isfinite(s.value).all() for s in spoilt.signals.values())


@pytest.mark.parametrize("difference", [d for d in wild_loader.DIFFERENCES if "." not in "".join(d.ranges)])
def test_every_vice_of_the_loaders_sensors_changes_the_recording(difference: Difference) -> None:
    """Only the signals that it is of, and never a stamp's order."""
    time_s = np.arange(0.0, 40.0, 0.01)
    rng = np.random.default_rng(1)
    names = (
        "lift_arm_angle",
        "specific_force_x",
        "specific_force_y",
        "specific_force_z",
        "wheel_speed_front_left",
    )
    names += (*wild_loader.LATE, "roll_rate", "pitch_rate", "yaw_rate")
    good = Recording(
        "drive",
        {name: signal(time_s, np.sin(time_s) + rng.normal(0.0, 0.01, time_s.size), "1") for name in names},
    )
    values = {key: high for key, (_, high) in difference.ranges.items()}
    spoilt = wild_loader.spoilt(good, values, np.random.default_rng(2))
    moved = [
        name
        for name in names
        if not np.array_equal(good.signals[name].value, spoilt.signals[name].value)
        or not np.array_equal(good.signals[name].time_s, spoilt.signals[name].time_s)
    ]
    assert 1 <= len(moved) <= 4
    assert all(np.all(np.diff(s.time_s) > 0.0) for s in spoilt.signals.values())


@pytest.mark.parametrize("name", NAMES)
def test_a_twin_does_what_the_effect_does(name: str) -> None:
    body = wild.BODIES[name]
    effect = next(e for e in body.model().effects if e.kind == "physics")
    model = wild.twinned(body.model(), effect)
    arm = Arm(body=body.name, kind="null", seed=3, noise="white")
    problem = Problem(model, body.record({}, arm, np.random.default_rng(3)))
    p, start = effect.parameters[0], problem.start()
    one, other, none = (
        problem.predict(start.having(**values))
        for values in ({p.name: p.value + p.typical}, {f"{p.name}_twin": p.value + p.typical}, {})
    )
    np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
    assert np.max(np.abs(one - none)) > 0.0


class Lanes:
    """A simulation that takes many windows at once; each result is the sum of the values."""

    def __call__(self, window, values, extra):
        return {"sum": sum(values.values())}

    def together(self, windows, values):
        return [self(window, values, {}) for window in windows]


def test_a_twin_simulates_many_windows_at_once_where_the_effect_does() -> None:
    both = wild.Twinned(Lanes(), {"grade": 1.0}, {"grade": "grade_twin"})
    values = {"grade": 3.0, "grade_twin": 5.0}
    assert both.together([None, None], values) == [both(None, values, {})] * 2 == [{"sum": 7.0 + 5.0}] * 2
    alone = wild.Twinned(lambda *_: {}, {"grade": 1.0}, {"grade": "grade_twin"})
    assert not hasattr(alone, "together")


def test_what_counts_as_a_false_name() -> None:
    """late brake has no fair name; a resistance of another power may be called quadratic drag."""
    assert page.false_names(done("null", "late brake", named("brake fade"))) == ["brake fade"]
    assert page.false_names(done("null", "resistance of another power", named("quadratic drag"))) == []
    assert page.false_names(done("effect", "late brake", named("slope"), effects=("slope",))) == []
    in_group = done("effect", "late brake", named("speed delay", "motor lag"), effects=("motor lag",))
    assert page.false_names(in_group) == []
    assert page.false_names(done("twin", "", named("slope twin"), effects=("slope",))) == []
    proxy = finding("brake fade", "physics", {"brake fade": 1.0}, named=False)
    assert page.false_names(done("null", "late brake", proxy)) == []


def test_the_page_counts_what_was_found() -> None:
    runs = [
        done("null", "late brake + clock drift", named("brake fade")),
        done("null", "late brake + clock drift"),
        done("effect", "late brake + clock drift", named("slope"), effects=("slope",)),
        done("twin", "", named("slope", "slope twin"), effects=("slope",)),
        done("twin", "", named("slope"), effects=("slope",)),
    ]
    cells = page.measured(runs)
    assert cells["nothing hidden: a wrong name"][0].startswith("1 of 2 ")
    assert cells["nothing hidden: a wrong name"][1] is False
    assert cells["one effect hidden, lambda >= 50: in a named group"] == ("1 of 1 (100 %; 21 to 100)", True)
    assert cells["exact twins reported as a group, where one is found"][0].startswith("1 of 2 ")
    text = page.page(runs, {}, 5, "command", "abc")
    assert "| straight null 1, " in text
    assert text.count("\n| straight | late brake |") == 1


def test_effects_that_were_not_reached_count_in_no_row() -> None:
    weak = done("effect", "late brake", effects=("slope",))
    weak = replace(weak, truth=Truth(reached=3.0))
    assert page.measured([weak])["one effect hidden, lambda >= 50: in a named group"][0] == "none run"


def test_effects_that_the_differences_bury_do_not_count_as_visible() -> None:
    row, silent = (
        "of those with lambda >= 50 beside the differences too: in a named group",
        "of the same: said that nothing is missing",
    )
    buried = done("effect", "late brake", effects=("slope",))
    seen = done("effect", "late brake", named("slope"), effects=("slope",))
    buried, seen = (
        replace(run, truth=Truth(reached=250.0, beside=beside))
        for run, beside in ((buried, 49.0), (seen, 51.0))
    )
    cells = page.measured([buried, seen])
    assert cells[row][0].startswith("1 of 1 ")
    assert cells[silent][0].startswith("0 of 1 ")
    quiet = replace(buried, truth=seen.truth)
    quiet = replace(quiet, findings=replace(quiet.findings, status="nothing missing"))
    cells = page.measured([quiet, seen])
    assert cells[silent] == ("1 of 2 (50 %; 9 to 91)", False)
