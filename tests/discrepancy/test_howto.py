"""The example of the how-to runs as printed."""

import re
from pathlib import Path

import pytest

from tests.conftest import ROOT


def test_the_example_model_finds_its_leak(capsys: pytest.CaptureFixture[str]) -> None:
    text = Path(ROOT / "docs/howto/write-a-model.md").read_text()
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL)
    assert code is not None
    names: dict[str, object] = {}
    exec(code[1], names)
    said = capsys.readouterr().out
    assert said.startswith("explained ['leak']")
    assert names["result"].findings[0].parameters[0].value == pytest.approx(0.05, abs=0.005)  # type: ignore[attr-defined]
