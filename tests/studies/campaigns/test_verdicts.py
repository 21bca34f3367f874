"""What a campaign aims at is a test case each: a missed aim fails, one without a drive is inconclusive."""

import json

import pytest
import typer
from typer.testing import CliRunner

from hil.ending import Ending
from hil.results import ending_of
from hil.verdict import Result
from loaderhil.result_commands import campaign_normal_force, campaign_roll_over
from studies.campaigns import normal_force, roll_over, roll_over_extended
from studies.campaigns.verdicts import accuracy
from studies.campaigns.verdicts import roll_over as suite_of

STANDING = [10e3, 20e3, 30e3, 40e3]
CALM = {"lift_off_s": None, "margin": 0.6, "false_alarm": False, "lead_s": None, "limited_lifts": False}
LIFTING = CALM | {"lift_off_s": 2.0, "margin": 0.0, "lead_s": 0.4}


def drive(*rms):
    return {"rms": list(rms), "standing": STANDING, "valid": 1.0}


@pytest.mark.parametrize(
    ("rms", "result"),
    [
        ((300.0, 600.0, 900.0, 1200.0), Result.PASSED),
        ((301.0, 0.0, 0.0, 0.0), Result.FAILED),
        ((0.0, 0.0, 0.0, float("nan")), Result.INCONCLUSIVE),
    ],
)
def test_the_worst_wheel_decides_on_the_accuracy(rms, result):
    assert accuracy("loaded", drive(*rms), 0.03).result is result


def results(*found):
    return [case.result for case in suite_of("level", found, 0.3).cases]


def test_each_aim_of_the_roll_over_campaign_fails_by_itself():
    passed, failed = Result.PASSED, Result.FAILED
    assert results(CALM, LIFTING) == [passed, passed, passed]
    for late in (None, 0.0, -0.1):
        assert results(CALM, LIFTING | {"lead_s": late}) == [failed, passed, passed]
    assert results(CALM | {"false_alarm": True}, LIFTING) == [passed, failed, passed]
    assert results(CALM, LIFTING | {"limited_lifts": True}) == [passed, passed, failed]


def test_a_grid_without_such_turns_leaves_the_aim_open():
    assert results(CALM) == [Result.INCONCLUSIVE, Result.PASSED, Result.INCONCLUSIVE]
    # near lift-off a warning is right even if no wheel lifts
    assert results(CALM | {"margin": 0.2, "false_alarm": True}, LIFTING)[1] is Result.INCONCLUSIVE


@pytest.mark.parametrize(
    ("module", "command", "words"),
    [
        (normal_force, campaign_normal_force, []),
        (roll_over, campaign_roll_over, []),
        (roll_over_extended, campaign_roll_over, ["--extended"]),
    ],
)
def test_every_campaign_gives_verdicts_for_machines(monkeypatch, tmp_path, module, command, words):
    suites = [suite_of("level", [CALM, LIFTING | {"limited_lifts": True}], 0.3)]
    monkeypatch.setattr(module, "run_campaign", lambda *_: (tmp_path / "page.md", suites))
    app = typer.Typer()
    app.command()(command)
    done = CliRunner().invoke(app, [*words, "--json", "--junit", str(tmp_path / "x.xml")])
    assert done.exit_code == Ending.FAILED
    given = json.loads(done.stdout)
    assert given["exit_code"] == Ending.FAILED
    assert given["page"] == str(tmp_path / "page.md")
    assert [case["result"] for case in given["suites"][0]["cases"]] == ["PASSED", "PASSED", "FAILED"]
    assert b"1 of 1 turns still lift a wheel" in (tmp_path / "x.xml").read_bytes()


def test_an_open_aim_is_no_pass():
    assert ending_of(case.result for case in suite_of("level", [CALM], 0.3).cases) is Ending.INCONCLUSIVE
    assert ending_of([]) is Ending.PASSED
