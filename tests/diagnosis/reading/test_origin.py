"""Whose recordings they are decides the baseline, and one line says so."""

from pathlib import Path

import pytest

from diagnosis.fleet.fleet import diagnosed, summary
from diagnosis.models import NAMED
from diagnosis.question import Question
from diagnosis.reading.origin import Base, OtherMachine, base_of
from diagnosis.reading.reading import ReadOptions
from discrepancy.signals.findings import from_json
from tests.diagnosis.cases import columns, model_file, write_csv
from tests.discrepancy.toys import record

LOADER = NAMED["loader"]


def test_without_a_record_the_baseline_is_the_models_own_and_that_is_said() -> None:
    base = base_of(LOADER, None, {})
    assert base.given is None
    assert "machine l60, the model's own" in base.description
    assert "--with" in base.description


def test_what_the_user_names_is_taken_for_a_machine_of_the_same_family(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('base = "l60"\nname = "mine"\n')
    for machines in ({}, {"run": "l60"}, {"run": "l60_shaft"}, {"run": "moved/away.toml"}):
        assert base_of(LOADER, mine, machines) == Base(mine, f"machine {mine}, as --with says")
    with pytest.raises(
        OtherMachine, match=r"machine compact \(family compact\), the baseline is .*mine\.toml \(family l60\)"
    ):
        base_of(LOADER, mine, {"run": "compact"})


def test_several_runs_of_one_machine_have_one_baseline() -> None:
    base = base_of(LOADER, None, {"one": "l60_shaft", "two": "l60_shaft", "three": "l60_shaft"})
    assert base == Base(Path("l60_shaft"), "machine l60_shaft, as run.json of one and of 2 more says")


def test_a_machine_file_that_is_gone_must_be_named() -> None:
    with pytest.raises(
        OtherMachine, match=r"says machine moved/away\.toml, for which there is no machine file; --with"
    ):
        base_of(LOADER, None, {"run": "moved/away.toml"})


def test_a_model_without_machines_has_nothing_to_say() -> None:
    assert base_of(NAMED["ball"], Path("ball.toml"), {}) == Base(
        Path("ball.toml"), "ball.toml, as --with says"
    )
    assert base_of(NAMED["ball"], None, {}) == Base(None)


def test_a_row_of_each_says_what_its_recording_was_compared_with(tmp_path: Path) -> None:
    file, given = write_csv(tmp_path / "a.csv", columns(record(1))), tmp_path / "given.toml"
    given.write_text('model = "tank"\n')
    row = diagnosed(Question(model=str(model_file(tmp_path)), given=given, options=ReadOptions(paths=[file])))
    assert row["baseline"] == f"{given}, as --with says"
    assert from_json(str(row["findings"])).baseline == row["baseline"]
    assert f"  1 of 1 compared with {given}" in summary([row], {})
