"""findings.json, its schema, the words and the command's errors."""

import io
import json

import pytest
from pydantic import ValidationError
from rich.console import Console

from discrepancy.examine import examine
from discrepancy.findings import SCHEMA, Findings, from_json, schema_text, to_json
from discrepancy.search import Settings
from discrepancy.words import most_improved, tell
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
