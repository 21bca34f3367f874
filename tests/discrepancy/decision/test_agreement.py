"""Recordings of one machine agree on a size; recordings of two do not, and that is told with the size in each."""

import re
from dataclasses import replace

import pytest

from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from tests.discrepancy.toys import record, tank

SETTINGS = Settings(open_ended=False)


def told(*leaks: float, first: int = 100) -> list[str]:
    """What is said of disagreement on recordings with these leaks, called a, b, ..."""
    recordings = [
        replace(record(first + i, leak=leak), name=chr(ord("a") + i)) for i, leak in enumerate(leaks)
    ]
    result = examine(tank("leak"), recordings, SETTINGS)
    assert result.named == ["leak"]
    return [reason for reason in result.reasons if "do not agree" in reason]


@pytest.mark.parametrize("first", range(100, 118, 3))
def test_recordings_of_one_size_agree(first: int) -> None:
    assert told(0.05, 0.05, 0.05, first=first) == []


def test_recordings_of_two_sizes_are_told_with_both() -> None:
    [text] = told(0.08, 0.03)
    sizes = [float(size) for size in re.findall(r"([.\d]+) 1/s in", text)]
    assert sizes == pytest.approx([0.08, 0.03], rel=0.15)  # to first order


def test_of_many_only_the_ends_are_told() -> None:
    [text] = told(0.05, 0.08, 0.05, 0.05, 0.03)
    assert re.findall(r"in (\w)\b", text) == ["e", "b"]


def test_a_single_recording_agrees_with_itself() -> None:
    assert told(0.08) == []
