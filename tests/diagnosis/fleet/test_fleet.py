"""`diagnose --each`: a fleet of recordings into one table, the same verdicts as one by one, taken up where it was."""

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from discrepancy.signals.findings import from_json
from tests.diagnosis.cases import Call, columns, loaderhil, model_file, write_csv
from tests.discrepancy.toys import record

__all__ = ["loaderhil"]

pytestmark = [pytest.mark.processes, pytest.mark.timeout(180)]


def test_each_recording_has_its_own_verdict_and_is_not_diagnosed_twice(
    loaderhil: Call, tmp_path: Path
) -> None:
    model = model_file(tmp_path)
    leaky = write_csv(tmp_path / "leaky.csv", columns(record(2, leak=0.08)))
    whole = write_csv(tmp_path / "whole.csv", columns(record(1)))
    (tmp_path / "empty.csv").write_text("")
    files, folder = (leaky, whole, tmp_path / "empty.csv"), tmp_path / "fleet"
    ended = loaderhil("diagnose", *files, "--model", model, "--each", "--workers", 2, folder=folder)
    assert ended.code == 0
    assert "3 recordings" in ended.out
    assert "  empty.csv: inconclusive: is empty" in ended.out
    rows = {row["recording"]: row for row in pq.read_table(folder / "results.parquet").to_pylist()}
    assert {name: row["status"] for name, row in rows.items()} == {
        "leaky.csv": "explained",
        "whole.csv": "nothing missing",
        "empty.csv": "inconclusive",
    }
    alone = loaderhil("diagnose", leaky, "--model", model)
    assert alone.result is not None
    assert from_json(rows["leaky.csv"]["findings"]) == alone.result
    assert rows["leaky.csv"]["value"] == alone.result.findings[0].parameters[0].value
    assert "is empty" in rows["empty.csv"]["reason"]

    kept = {file.name: file.stat().st_mtime_ns for file in (folder / "arms").iterdir()}
    write_csv(tmp_path / "empty.csv", columns(record(4)))
    loaderhil("diagnose", *files, "--model", model, "--each", folder=folder)
    now = {file.name: file.stat().st_mtime_ns for file in (folder / "arms").iterdir()}
    assert kept.items() < now.items()
    assert len(now) == 4

    other = loaderhil("diagnose", leaky, "--model", model_file(tmp_path, "leak"), "--each", folder=folder)
    assert other.code == 2
    assert f"holds results of another content of {model}; give another folder" in other.err


def test_what_each_does_not_go_with_is_one_line(loaderhil: Call, tmp_path: Path) -> None:
    model = model_file(tmp_path)
    file = write_csv(tmp_path / "a.csv", columns(record(1)))
    for words in (("--each", "--apply", tmp_path / "a.toml"), ("--workers", 2)):
        ended = loaderhil("diagnose", file, "--model", model, *words)
        assert ended.code == 2
        assert "--each" in ended.err.strip().splitlines()[-1]
