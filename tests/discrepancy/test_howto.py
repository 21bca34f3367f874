"""The example of the how-to runs as printed."""

import re
import shlex
import sys
from pathlib import Path

import pytest

from loaderhil import cli
from tests.conftest import ROOT

TEXT = Path(ROOT / "docs/howto/write-a-model.md").read_text()
CODE = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


def test_the_example_model_finds_its_leak(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {}
    for block in CODE:
        exec(block, names)
    said = capsys.readouterr().out
    assert said.startswith("explained ['leak']")
    assert names["result"].findings[0].parameters[0].value == pytest.approx(0.05, abs=0.005)  # type: ignore[attr-defined]


def test_the_commands_of_the_example_end_as_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tank.py").write_text(CODE[0])
    commands = [c for c in re.findall(r"^    (loaderhil .*)$", TEXT, re.MULTILINE) if "out/tank" in c]
    assert [c.split()[1] for c in commands] == ["conceal", "diagnose", "score"]
    for command in commands:
        capsys.readouterr()
        monkeypatch.setattr(sys, "argv", shlex.split(command))
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert not ended.value.code, command
    said = " ".join(capsys.readouterr().out.split())
    shown = TEXT[TEXT.index("    verdict: explained") :].split("\n\n")[0]
    for line in shown.splitlines():
        # the seed fixes the noise, the last digit may differ by processor
        assert " ".join(line.split()).partition("0.05002")[0].strip() in said
