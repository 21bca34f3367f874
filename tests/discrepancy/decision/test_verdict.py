"""The verdict in one word and its reasons."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.verdict import contradicted, of_proxies
from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import BaselineValue, Estimate
from tests.diagnosis.cases import finding
from tests.discrepancy.room import evening, room
from tests.discrepancy.toys import record, tank

DAMPING = BaselineValue(
    estimate=Estimate(name="damping", value=2.6e-10, low=0.0, high=40.0, unit="N.s/m", at_bound="lower", baseline=500.0),
    prior_sd=200.0,
    away=2.5,
    sure=False,
)  # fmt: skip


def test_a_value_at_its_bound_is_said_to_be_there() -> None:
    """2.6e-10 N·s/m is where a fit ended, not what was found."""
    said = contradicted(DAMPING)
    assert "was pushed from 500 N·s/m to its bound, 0 N·s/m, 2.5 standard deviations" in said
    free = replace(DAMPING, estimate=replace(DAMPING.estimate, value=30.0, high=70.0, at_bound=None))
    assert "to 30 N·s/m (95 %: 0 N·s/m to 70 N·s/m)" in contradicted(free)


@pytest.mark.parametrize(("duration_s", "said"), [(100.0, True), (240.0, False)])
def test_what_was_not_looked_for_is_said(duration_s: float, said: bool) -> None:
    """Windows of 20 s: five are too few to compare a part of the time with the rest."""
    result = examine(tank(), [record(1, duration_s=duration_s)], Settings(open_ended=False))
    assert any("for a part of the time were not looked for" in reason for reason in result.reasons) is said


def test_a_simulation_that_is_worse_than_its_readings_is_not_explained_but_in_part() -> None:
    """Waves on the surface, ten times a reading's error, that nobody recorded; with `disturbances` in the model they are none of its faults."""
    drained = record(3, leak=0.1, duration_s=240.0)
    level = drained.signals["level"]
    waves = level.value + 0.08 * np.sin(2.0 * np.pi * level.time_s / 7.0)
    seen = replace(drained, signals={**drained.signals, "level": replace(level, value=waves)})
    plain = examine(tank("leak"), [seen], Settings(open_ended=False))
    stated = examine(replace(tank("leak"), disturbances={"level": 0.1}), [seen], Settings(open_ended=False))
    assert (plain.named, stated.named) == (["leak"], ["leak"])
    assert (plain.status, stated.status) == ("explained in part", "explained")


def test_a_value_that_may_stand_in_for_something_leaves_a_question_open() -> None:
    """A scale of 0.85 is another area; the sway of the surface, which no model here has, is more than the reading's error."""
    drained = record(3, leak=0.1, duration_s=240.0)
    level = drained.signals["level"]
    swaying = 0.85 * level.value + 0.08 * np.sin(2.0 * np.pi * level.time_s / 7.0)
    seen = replace(drained, signals={**drained.signals, "level": replace(level, value=swaying)})
    result = examine(tank("leak"), [seen], Settings(open_ended=False))
    assert (result.named, [value.sure for value in result.baseline_values]) == (["leak"], [False])
    assert result.status == "explained in part"
    assert any(
        "times what a reading is off by: that is within a tenth of its movement" in r for r in result.reasons
    )


def test_beside_an_equation_nothing_is_explained_but_in_part() -> None:
    """A leak, and a slight curvature of the gauge that no effect here is: little of the difference, but without a name."""
    recording = record(5, leak=0.1, square=0.004, noise=0.005, duration_s=240.0)
    result = examine(tank("leak"), [recording], Settings())
    assert result.named == ["leak"]
    assert result.open_ended is not None
    assert result.status == "explained in part"


@pytest.mark.parametrize(("opened_at", "said"), [(720, False), (730, True), (775, False)])
def test_an_error_where_an_effect_begins_is_said_to_be_there(opened_at: int, said: bool) -> None:
    """A window has 120 samples, and 30 where the leak begins: it opens at the edge of one, or 10 or 5 samples beside it."""
    recording = evening(2, leak=60.0, leak_from=opened_at)
    result = examine(room("leak"), [recording], Settings(open_ended=False))
    assert result.named == ["leak"]
    assert any("that is where leak begins or ends" in reason for reason in result.reasons) is said
    assert result.status == ("explained in part" if said else "explained")


@pytest.mark.parametrize(("delay_s", "said"), [(0.35, True), (0.0, False)])
def test_a_reading_that_is_the_only_one_and_late_may_be_an_input_that_acts_late(
    delay_s: float, said: bool
) -> None:
    late = record(2, delay_s=delay_s, bias=0.0 if delay_s else 0.3)
    result = examine(tank("level delay", "level bias"), [late], Settings(open_ended=False))
    assert result.named == ["level delay" if said else "level bias"]
    expected = "the only reading comes late by 0.35 s: inflow acting late by that, or stamped early, would look the same"
    assert (expected in result.reasons) is said


def test_the_reasons_of_many_best_proxies_stand_with_each_and_not_in_the_verdict() -> None:
    """With a page of reasons, what a reader needs first would be lost in it."""
    proxies = [
        replace(finding(name, "physics", {name: 1.0}, named=False), caveats=["hardly helps"])
        for name in "abc"
    ]
    few, many = of_proxies(proxies[:2]), of_proxies(proxies)
    assert few == [f"{name} is only the best proxy, the cause is unknown: hardly helps" for name in "ab"]
    [said] = many
    assert said.startswith("a, b and c are only best proxies")
    assert "hardly helps" not in said
