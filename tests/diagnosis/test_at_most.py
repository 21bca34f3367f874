"""`diagnose --at-most`."""

from pathlib import Path

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


def test_it_is_for_one_diagnosis(tmp_path: Path, loaderhil: Call) -> None:
    write_csv(tmp_path / "a.csv", columns(record(2, leak=0.08)))
    asked = ("diagnose", tmp_path / "a.csv", "--model", model_file(tmp_path), "--out", tmp_path / "out")
    assert loaderhil(*asked, "--each", "--at-most", 10).code == 2
