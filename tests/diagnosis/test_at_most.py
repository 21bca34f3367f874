"""`diagnose --at-most`."""

import math
from collections.abc import Callable
from itertools import count
from pathlib import Path

import pytest

from diagnosis import command
from tests.diagnosis.cases import Call, columns, loaderhil, model_file, write_csv
from tests.discrepancy.toys import record

__all__ = ["loaderhil"]


def test_a_search_without_time_ends_with_a_verdict_and_a_file(tmp_path: Path, loaderhil: Call) -> None:
    write_csv(tmp_path / "a.csv", columns(record(2, leak=0.08)))
    asked = ("diagnose", tmp_path / "a.csv", "--model", model_file(tmp_path))
    ended = loaderhil(*asked, "--at-most", 0)
    assert ended.code == 1
    assert ended.result is not None
    assert ended.result.status == "unknown"
    assert "ended at its time limit" in ended.result.reasons[0]
    assert ended.result.adequacy
    assert loaderhil(*asked, "--at-most", 1e6).code == 0


@pytest.mark.parametrize("seconds", [0.0, 1e6])
def test_a_length_of_windows_for_which_no_time_is_left_contradicts_nothing(
    tmp_path: Path, loaderhil: Call, seconds: float
) -> None:
    write_csv(tmp_path / "a.csv", columns(record(2, leak=0.08)))
    asked = ("diagnose", tmp_path / "a.csv", "--model", model_file(tmp_path), "--window", 15)
    ended = loaderhil(*asked, "--at-most", seconds)
    assert ended.result is not None
    said = "windows of 15 s were not tried: the time was over"
    assert (said in ended.result.reasons) == (seconds == 0.0)
    assert not any("depends on the length" in reason for reason in ended.result.reasons)


def test_a_search_with_other_windows_that_is_cut_contradicts_nothing(
    tmp_path: Path, loaderhil: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Time is counted in questions whether it is over: as many as the first diagnosis asks, and the one before the second."""
    write_csv(tmp_path / "a.csv", columns(record(2, leak=0.08)))
    asked = ("diagnose", tmp_path / "a.csv", "--model", model_file(tmp_path), "--at-most", 1)
    questions = count()

    def over_from(last: float) -> Callable[[float], Callable[[], bool]]:
        return lambda _: lambda: next(questions) >= last

    monkeypatch.setattr(command, "over_after", over_from(math.inf))
    alone = loaderhil(*asked).result
    whole = next(questions)
    questions = count()
    monkeypatch.setattr(command, "over_after", over_from(whole + 1))
    both = loaderhil(*asked, "--window", 15).result
    assert alone is not None
    assert both is not None
    assert next(questions) > whole + 1
    assert (both.status, both.named) == (alone.status, alone.named) == ("explained", ["leak"])
    assert "windows of 15 s were not tried: the time was over" in both.reasons


def test_it_is_for_one_diagnosis(tmp_path: Path, loaderhil: Call) -> None:
    write_csv(tmp_path / "a.csv", columns(record(2, leak=0.08)))
    asked = ("diagnose", tmp_path / "a.csv", "--model", model_file(tmp_path), "--out", tmp_path / "out")
    assert loaderhil(*asked, "--each", "--at-most", 10).code == 2
