"""findings.json, its schema, the words and the command's errors."""

import io
import json
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from rich.console import Console

from discrepancy.examine import examine
from discrepancy.findings import SCHEMA, Estimate, Findings, Separation, from_json, schema_text, to_json
from discrepancy.state import Settings
from discrepancy.words import (
    expected_difference,
    most_improved,
    noticed,
    number_and_unit,
    rounded,
    tell,
    told_verdict,
)
from tests.discrepancy.toys import record, tank


def test_the_schema_in_the_repository_is_that_of_the_classes() -> None:
    assert SCHEMA.read_text() == schema_text()


def test_findings_survive_json_and_say_what_was_found() -> None:
    result = examine(tank(), [record(2, leak=0.08)], Settings())
    text = to_json(result)
    assert "NaN" not in text
    assert "Infinity" not in text
    back = from_json(text)
    assert back.findings[0].effect == "leak"
    assert to_json(back) == text


def test_a_damaged_file_is_refused_with_the_place() -> None:
    whole = json.loads(to_json(examine(tank(), [record(2)], Settings())))
    whole["status"] = "perhaps"
    with pytest.raises(ValidationError, match="status"):
        from_json(json.dumps(whole))


def test_many_channels_are_told_by_the_best_and_their_number() -> None:
    error = {"a": 0.9, "b": 0.1, "c": 1.2, "d": 0.5}
    assert most_improved(error, 2) == ({"b": 0.1, "d": 0.5}, 2)
    assert list(most_improved(error, 9)[0]) == ["b", "d", "a", "c"]
    assert most_improved(error, 9)[1] == 0


def test_the_words_name_effect_value_and_what_was_ruled_out() -> None:
    out = io.StringIO()
    tell(examine(tank(), [record(2, leak=0.08)], Settings()), Console(file=out, width=160))
    text = out.getvalue()
    for expected in ("explained", "leak = 0.0", "closes", "ruled out", "level delay"):
        assert expected in text


def test_reasons_longer_than_the_terminal_are_wrapped_not_cut() -> None:
    out = io.StringIO()
    reason = "no effect and no function of the known signals improves the prediction of held-out data " * 2
    result = Findings(model="tank", recordings=["r"], status="nothing missing", reasons=[reason.strip()])
    tell(result, Console(file=out, width=60, soft_wrap=True))
    words = [w for line in out.getvalue().splitlines() for w in line.strip("│ ").split()]
    assert " ".join(words).count("held-out data") == 2


@given(value=st.floats(-1e6, 1e6), uncertainty=st.floats(1e-6, 1e6))
def test_a_number_is_told_to_two_digits_of_what_is_uncertain_of_it(value: float, uncertainty: float) -> None:
    text = rounded(value, uncertainty)
    assert abs(float(text) - value) <= 0.051 * uncertainty
    assert not text.startswith("-0") or float(text) != 0.0
    # one digit less would lose more than that
    assert len(text.partition(".")[2]) <= max(0, 1 - math.floor(math.log10(uncertainty)))


def test_a_size_carries_no_more_digits_than_its_interval_leaves() -> None:
    delay = Estimate(name="delay", value=0.09619, low=0.09341, high=0.09893, unit="s")
    assert number_and_unit(delay) == "delay = 0.0962 s (95 %: 0.0934 to 0.0989)"
    mass = Estimate(name="mass", value=11280.4, low=10900.0, high=11660.0, unit="kg")
    assert number_and_unit(mass) == "mass = 11280 kg (95 %: 10900 to 11660)"
    plain = Estimate(name="cubic", value=-0.00013, low=None, high=None, unit="m.s^2/rad^2")
    assert number_and_unit(plain) == "cubic = -0.00013 m·s²/rad²"


def test_what_was_found_and_is_not_the_cause_is_told_as_a_proxy() -> None:
    result = examine(tank(), [record(2, leak=0.08)], Settings())
    [leak] = [c for c in result.candidates if c.effect == "leak"]
    assert told_verdict(leak, result) == "found"
    doubted = replace(result, findings=[replace(f, named=False) for f in result.findings])
    assert told_verdict(leak, doubted) == "best proxy"


@pytest.mark.parametrize(
    ("size", "told"),
    [(None, ""), (37.2, " (expected difference 37)"), (3.6e7, " (expected difference over 1000)")],
)
def test_a_difference_that_is_sure_needs_no_size(size: float | None, told: str) -> None:
    assert expected_difference(Separation(effect="a", manoeuvre="b", expected_difference=size)) == told


def test_what_is_smaller_than_noticed_from_is_not_found_and_what_is_larger_is() -> None:
    """The size comes from one recording without the effect, and holds for others with it."""
    model, settings = tank("level delay"), Settings(open_ended=False)
    [limit] = examine(model, [record(1)], settings).candidates[0].noticed_from
    assert limit.name == "level.delay"
    for share, found in ((0.4, []), (1.6, ["level delay"])):
        for seed in range(2, 8):
            late = record(seed, delay_s=share * limit.value)
            assert examine(model, [late], settings).named == found


@pytest.mark.parametrize(
    ("off", "on", "unit", "told"),
    [(0.0, 60.0, "kg", "60 kg"), (1.0, 0.93, "1", "-0.07 from 1"), (0.05, 0.0512, "1/s", "+0.0012 1/s from 0.05")],
)  # fmt: skip
def test_what_is_noticed_is_told_as_a_change_of_what_is_there(
    off: float, on: float, unit: str, told: str
) -> None:
    candidate = examine(tank("leak"), [record(1)], Settings(open_ended=False)).candidates[0]
    limit = Estimate(name="x", value=on, low=None, high=None, unit=unit, baseline=off)
    assert noticed(replace(candidate, noticed_from=[limit])) == told
    assert noticed(replace(candidate, noticed_from=[])) == "–"


def test_no_size_is_noticed_of_what_nuisances_can_do_as_well() -> None:
    [sign] = [c for c in examine(tank(), [record(1)], Settings()).candidates if c.effect == "level sign"]
    assert (sign.verdict, sign.noticed_from) == ("could not be judged", [])


def test_names_are_whole_in_a_terminal_of_80_columns() -> None:
    """Three of four wheels' sensors read alike where the ends of their names were cut off."""
    result = examine(tank(), [record(1)], Settings(open_ended=False))
    long = [
        replace(c, effect=f"wheel_speed_front_{side} scale", verdict="could not be judged")
        for c, side in zip(result.candidates, ("left", "right"), strict=False)
    ]
    out = io.StringIO()
    tell(replace(result, candidates=long), Console(file=out, width=80))
    for candidate in long:
        assert any(line.startswith(candidate.effect) for line in out.getvalue().splitlines())
