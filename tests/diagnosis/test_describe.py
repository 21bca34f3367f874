"""Numbers and candidates in plain English."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.describe import (
    errors,
    estimate,
    evidence,
    expected_evidence,
    most_improved,
    remaining,
    rounded,
    share,
    smallest_detectable,
    verdict,
)
from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from discrepancy.signals.adequacy import ChannelAdequacy
from discrepancy.signals.findings import Estimate, Findings, Separation
from tests.discrepancy.toys import record, tank

LEVEL = ChannelAdequacy(
    channel="level", unit="m", budget=0.01, source="differences", movement=1.0, one_step_budget=None, simulated_budget=0.1, one_step_before=0.05,
    one_step=0.01, simulated_before=0.8, simulated=0.04, adequate=True,
)  # fmt: skip


def test_every_result_says_how_much_is_still_wrong() -> None:
    good = Findings(
        model="tank", recordings=["r"], status="explained", reasons=[], samples=9, adequacy=[LEVEL]
    )
    assert remaining(good) == [
        "within the error budgets: level is simulated to 0.04 m, within its budget of 0.1 m"
    ]
    beyond = [replace(LEVEL, simulated=0.3, adequate=False)]
    (said,) = remaining(replace(good, adequacy=beyond))
    assert said == "still wrong: level is simulated to 0.3 m, 3 times its budget of 0.1 m"
    assert remaining(replace(good, adequacy=beyond, reasons=[said])) == []
    assert "earlier version" in remaining(replace(good, adequacy=[]))[0]


def test_errors_are_shown_before_and_after_in_readable_units() -> None:
    assert errors(0.8, 0.04, "m") == "0.8 → 0.04 m"
    assert errors(0.04, 0.04, "m") == "0.04 m"
    assert errors(250e3, 30e3, "Pa") == "250 → 30 kPa"


def test_a_loss_is_no_evidence() -> None:
    assert [evidence(gain) for gain in (-26.0, 37.4, 5000.0)] == ["none", "37", "over 1000"]


def test_many_channels_are_the_best_and_a_number() -> None:
    error = {"a": 0.9, "b": 0.1, "c": 1.2, "d": 0.5}
    assert most_improved(error, 2) == ({"b": 0.1, "d": 0.5}, 2)
    assert list(most_improved(error, 9)[0]) == ["b", "d", "a", "c"]
    assert most_improved(error, 9)[1] == 0


@given(value=st.floats(-1e6, 1e6), uncertainty=st.floats(1e-6, 1e6))
def test_a_number_has_two_digits_of_its_uncertainty(value: float, uncertainty: float) -> None:
    text = rounded(value, uncertainty)
    assert abs(float(text) - value) <= 0.051 * uncertainty
    assert not text.startswith("-0") or float(text) != 0.0
    # one digit less would lose more than that
    assert len(text.partition(".")[2]) <= max(0, 1 - math.floor(math.log10(uncertainty)))


def test_a_size_has_the_digits_that_its_interval_supports() -> None:
    delay = Estimate(name="delay", value=0.09619, low=0.09341, high=0.09893, unit="s")
    assert estimate(delay) == "delay = 0.0962 s (95 %: 0.0934 to 0.0989)"
    mass = Estimate(name="mass", value=11280.4, low=10900.0, high=11660.0, unit="kg")
    assert estimate(mass) == "mass = 11280 kg (95 %: 10900 to 11660)"
    plain = Estimate(name="cubic", value=-0.00013, low=None, high=None, unit="m.s^2/rad^2")
    assert estimate(plain) == "cubic = -0.00013 m·s²/rad²"


def test_a_finding_that_is_not_the_cause_is_a_proxy() -> None:
    result = examine(tank(), [record(2, leak=0.08)], Settings())
    [leak] = [c for c in result.candidates if c.effect == "leak"]
    assert verdict(leak, result) == "found"
    doubted = replace(result, findings=[replace(f, named=False) for f in result.findings])
    assert verdict(leak, doubted) == "best proxy"


@pytest.mark.parametrize(
    ("size", "text"),
    [(None, ""), (37.2, " (expected evidence 37)"), (3.6e7, " (expected evidence over 1000)")],
)
def test_overwhelming_evidence_has_no_number(size: float | None, text: str) -> None:
    assert expected_evidence(Separation(effect="a", manoeuvre="b", expected_difference=size)) == text


@pytest.mark.parametrize(
    ("off", "on", "unit", "text"),
    [(0.0, 60.0, "kg", "60 kg"), (1.0, 0.93, "1", "-0.07 from 1"), (0.05, 0.0512, "1/s", "+0.0012 1/s from 0.05")],
)  # fmt: skip
def test_a_detectable_size_is_a_change_from_the_baseline(off: float, on: float, unit: str, text: str) -> None:
    candidate = examine(tank("leak"), [record(1)], Settings(open_ended=False)).candidates[0]
    limit = Estimate(name="x", value=on, low=None, high=None, unit=unit, baseline=off)
    assert smallest_detectable(replace(candidate, smallest_detectable=[limit])) == text
    assert smallest_detectable(replace(candidate, smallest_detectable=[])) == "–"


def test_nearly_all_is_not_all() -> None:
    assert [share(part) for part in (0.0, 0.001, 0.185, 0.996, 1.0)] == [
        "0 %",
        "under 1 %",
        "18 %",
        "over 99 %",
        "100 %",
    ]
