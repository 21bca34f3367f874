"""Files that loaderhil wrote on 2026-11-22, before its modules and words were re-arranged, are still of use.

old_files/ was made at commit cb411bc by `conceal --model ball --manoeuvre "thrown up" --effect "quadratic drag=0.5"` with a mass of 58 g and
a diameter of 6.7 cm, `diagnose recording.csv --apply ball.toml`, and nothing else.
"""

import io
import shutil
from pathlib import Path

import pytest
from rich.console import Console

from diagnosis.findings_file import read_findings
from diagnosis.page import page
from diagnosis.terminal import render
from tests.diagnosis.cases import Call, loaderhil

__all__ = ["loaderhil"]

OLD = Path(__file__).with_name("old_files")


def test_old_findings_are_shown_on_terminal_and_page() -> None:
    found = read_findings(OLD / "findings.json")
    assert (found.status, found.named) == ("explained", ["quadratic drag"])
    out = io.StringIO()
    render(found, Console(file=out, width=120))
    for text in (out.getvalue(), page(found, None, [], {})):
        assert "drag_coefficient = 0.5026 (95 %: 0.4930 to 0.5121)" in text


def test_an_old_sealed_folder_is_scored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "blind"
    shutil.copytree(OLD, folder)
    monkeypatch.setattr("sys.argv", ["loaderhil", "score", str(folder)])
    from loaderhil import cli

    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 0, capsys.readouterr().err
    assert "passed" in capsys.readouterr().out


def test_an_old_model_file_is_a_baseline(loaderhil: Call) -> None:
    found = loaderhil("diagnose", OLD / "recording.csv", "--model", "ball", "--with", OLD / "ball.toml")
    assert found.result is not None
    assert found.result.status in ("nothing missing", "inconclusive")
    assert found.result.named == []
