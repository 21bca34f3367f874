"""Several scenarios in one go: nothing starts before all is known to be sound; one table, one exit code."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from configuration import ConfigurationError
from hil.compose import Choice, ChoiceError
from hil.ending import Ending
from hil.rundir import RunError
from hil.verdict import Result, Verdict
from loaderhil import several
from loaderhil.several import report_runs
from testbench.conclusion import Conclusion, ending_of

SCENARIO = """
name = "{name}"
sentence = "Short."
duration_s = 0.3
machine = "l60"
"""


@pytest.fixture
def choose(tmp_path):
    """Choices of short scenarios."""

    def make(*names, changes=()):
        for name in names:
            (tmp_path / f"{name}.toml").write_text(SCENARIO.format(name=name))
        return [Choice(scenario=str(tmp_path / f"{name}.toml"), changes=changes) for name in names]

    return make


def run(choices, out):
    return report_runs(choices, out, realtime=None, strict=False)


def test_each_has_its_folder_and_the_table_names_them_all(choose, tmp_path, capsys):
    assert run(choose("one", "two", changes=("payload_kg=500",)), tmp_path / "out") is Ending.PASSED
    printed = capsys.readouterr().out
    for name in ("one", "two"):
        record = json.loads((tmp_path / "out" / name / "run.json").read_text())
        assert (record["scenario"], record["outcome"], record["payload_kg"]) == (name, "finished", 500.0)
        assert record["changes"] == ["payload_kg=500"]
        assert name in printed
    assert printed.count("true lift-off") == 1


def test_nothing_runs_when_one_of_them_is_wrong(choose, tmp_path):
    good, bad = choose("one", "two")
    (tmp_path / "two.toml").write_text(SCENARIO.format(name="two").replace("0.3", "-1"))
    with pytest.raises(ConfigurationError, match="duration_s"):
        run([good, bad], tmp_path / "out")
    with pytest.raises(ChoiceError, match="one is given twice"):
        run([good, good], tmp_path / "out")
    assert not (tmp_path / "out").exists()
    (tmp_path / "out" / "two").mkdir(parents=True)
    (tmp_path / "out" / "two" / "thesis.txt").write_text("mine")
    with pytest.raises(RunError, match="not empty"):
        run(choose("one", "two"), tmp_path / "out")
    assert not (tmp_path / "out" / "one").exists()


def test_ctrl_c_ends_all_with_the_table_of_those_done(choose, tmp_path, monkeypatch, capsys):
    original, started = several.run_with_progress, []

    def second_interrupted(choice, folder, **options):
        started.append(folder.name)
        result = original(choice, folder, **options)
        return result if len(started) == 1 else replace(result, ending=Ending.INTERRUPTED, reason="stopped")

    monkeypatch.setattr(several, "run_with_progress", second_interrupted)
    assert run(choose("one", "two", "three"), tmp_path / "out") is Ending.INTERRUPTED
    assert started == ["one", "two"]
    assert "stopped" in capsys.readouterr().out


def done(ending=Ending.PASSED, result=None, expected=None):
    def verdicts(of):
        return (Verdict(question="q", result=of, reason="r"),) if of else ()

    return Conclusion(
        name="name", folder=Path(), ending=ending, verdicts=verdicts(result), expectations=verdicts(expected)
    )


@pytest.mark.parametrize(
    ("runs", "strict", "ending"),
    [
        ([done(), done()], False, Ending.PASSED),
        ([done(), done(result=Result.FAILED)], False, Ending.FAILED),
        ([done(result=Result.INCONCLUSIVE)], False, Ending.PASSED),
        ([done(result=Result.INCONCLUSIVE)], True, Ending.FAILED),
        ([done(expected=Result.FAILED)], False, Ending.FAILED),
        ([done(expected=Result.INCONCLUSIVE)], False, Ending.INCONCLUSIVE),
        ([done(expected=Result.INCONCLUSIVE), done(expected=Result.FAILED)], False, Ending.FAILED),
        ([done(Ending.PEER_DIED), done(result=Result.FAILED)], False, Ending.PEER_DIED),
        ([done(Ending.PEER_DIED), done(Ending.INTERRUPTED)], False, Ending.INTERRUPTED),
    ],
)
def test_the_exit_code_is_the_gravest(runs, strict, ending):
    assert ending_of(runs, strict=strict) is ending
