"""Recordings of one machine agree on a size; recordings of two do not, and the complaint gives the size in each."""

import re
from dataclasses import replace

import pytest

from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from tests.discrepancy.toys import record, tank

SETTINGS = Settings(open_ended=False)


def disagreements(*leaks: float, first: int = 100, most: float = 1.0) -> list[str]:
    """What is said of disagreement on recordings with these leaks, called a, b, ...; most: bound of a leak in the model."""
    recordings = [
        replace(record(first + i, leak=leak), name=chr(ord("a") + i)) for i, leak in enumerate(leaks)
    ]
    plain = tank("leak")
    [leak] = plain.effects
    bounded = replace(leak, parameters=(replace(leak.parameters[0], upper=most),))
    result = examine(replace(plain, effects=(bounded,)), recordings, SETTINGS)
    assert result.named == ["leak"]
    return [reason for reason in result.reasons if "do not agree" in reason]


@pytest.mark.parametrize("first", range(100, 118, 3))
def test_recordings_of_one_size_agree(first: int) -> None:
    assert disagreements(0.05, 0.05, 0.05, first=first) == []


def test_recordings_that_disagree_are_reported_with_both_sizes() -> None:
    [text] = disagreements(0.08, 0.03)
    sizes = [float(size) for size in re.findall(r"([.\d]+) 1/s in", text)]
    assert sizes == pytest.approx([0.08, 0.03], rel=0.15)  # to first order


def test_a_size_of_one_recording_keeps_to_its_bounds() -> None:
    """To first order one passes the bound that a fit of that recording would keep to."""
    [text] = disagreements(0.08, 0.03, most=0.07)
    assert "0.07 1/s in a" in text


def test_of_many_recordings_only_the_extremes_are_reported() -> None:
    [text] = disagreements(0.05, 0.08, 0.05, 0.05, 0.03)
    assert re.findall(r"in (\w)\b", text) == ["e", "b"]


def test_a_single_recording_agrees_with_itself() -> None:
    assert disagreements(0.08) == []
