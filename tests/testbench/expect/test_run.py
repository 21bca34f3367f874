"""Expectations of whole runs in lockstep: exit code, summary, JSON, JUnit, and who detected a fault."""

import json
import re
from xml.etree import ElementTree as ET

import pytest

from hil.compose import Choice
from hil.ending import Ending
from hil.rundir import read_record
from hil.runs import run_lockstep
from hil.verdict import Result
from loaderhil.single import Output, report_run
from testbench.conclusion import conclude, ending_of

DRIVE = """
name = "drive"
sentence = "Drives straight on."
duration_s = 3.0
machine = "l60"
seed = 1

[start]
speed_kmh = 10.0

[driver.speed_kmh]
points = [[0.0, 10.0]]
"""
GOES_WELL = '[[expect]]\nkind = "no_lift_off"\n[[expect]]\nkind = "reaction"\nwithin_ms = 20\n'
TOO_FAST = '[[expect]]\nkind = "signal"\nsignal = "BodyMotion.Speed"\nmaximum = 1.0\nfrom_s = 1.0\n'
NEVER = '[[expect]]\nkind = "response"\ncause = "RollOver.State == lifted"\neffect = "Limits.Cause > 0"\nwithin_ms = 100\n'


@pytest.fixture
def result_of(tmp_path, capsys):
    """Runs a scenario with these tables at its end: ending, what was printed, run directory."""

    def run(tables, output=Output(), **choice):  # noqa: B008
        (tmp_path / "drive.toml").write_text(DRIVE + tables)
        chosen = Choice(scenario=str(tmp_path / "drive.toml"), **choice)
        out = tmp_path / "out"
        ending = report_run(chosen, out, realtime=None, strict=False, output=output)
        return ending, capsys.readouterr().out, out

    return run


@pytest.mark.parametrize(
    ("tables", "ending"),
    [
        ("", Ending.PASSED),
        (GOES_WELL, Ending.PASSED),
        (GOES_WELL + TOO_FAST, Ending.FAILED),
        (GOES_WELL + NEVER, Ending.INCONCLUSIVE),
        (NEVER + TOO_FAST, Ending.FAILED),
    ],
)
def test_the_exit_code_is_that_of_the_expectations(result_of, tables, ending):
    found, text, out = result_of(tables)
    assert found is ending
    assert len(read_record(out).expectations) == tables.count("[[expect]]")
    if TOO_FAST in tables:
        assert "FAILED       BodyMotion.Speed <= 1 m/s from 1 s on: 2." in text


def test_json_is_the_only_output_and_junit_agrees(result_of, tmp_path):
    ending, text, _ = result_of(
        GOES_WELL + TOO_FAST + NEVER, Output(json=True, junit=tmp_path / "new" / "j.xml")
    )
    content = json.loads(text)
    assert content["exit_code"] == ending == Ending.FAILED
    results = [case["result"] for case in content["suites"][0]["cases"]]
    assert results == ["PASSED", "PASSED", "PASSED", "FAILED", "INCONCLUSIVE"]
    suite = ET.parse(tmp_path / "new" / "j.xml").getroot()[0]
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("5", "1", "1")
    assert [case.get("name") for case in suite.iter("testcase")] == [
        case["question"] for case in content["suites"][0]["cases"]
    ]


def test_a_machine_that_rolls_over_is_said(tmp_path):
    choice = Choice(scenario="abrupt_articulation", limits=False)
    concluded = conclude("turn", choice, tmp_path / "r", run_lockstep(choice, tmp_path / "r"))
    rolled_over, degraded = concluded.remarks
    assert rolled_over.startswith("the machine rolled over at ")
    # Not long before: at 51 degrees of roll the slope sensor, which feels the acceleration too, has stood at its end of 60 degrees for
    # ten frames. It knows the roll no more, and the ECU is right to say that it does without; the test of sensors against each
    # other may say so while the machine falls.
    assert degraded.startswith("the ECU was in state degraded for ")
    (over_s,), (degraded_s,) = (re.findall(r"at (\d+\.\d+) s$", text) for text in (rolled_over, degraded))
    assert float(over_s) - 0.1 < float(degraded_s) < float(over_s) + 0.2


def test_an_ecu_in_fault_is_mentioned_in_the_summary(result_of):
    fault = '[[fault]]\nkind = "offset"\nmessage = "BodyAcceleration"\nsignal = "Vertical"\noffset = -60.0\nunit = "m/s2"\nat_s = 0.1\n'
    _, text, _ = result_of(fault + '[[expect]]\nkind = "state"\nis = "running"\nfrom_s = 1.0\n')
    assert "the ECU was in state" in text
    assert "FAILED       EcuStatus.State is running" in text


DROP = '[[fault]]\nkind = "drop"\nmessage = "BodyRates"\nat_s = 1.0\n'
QUIETLY = '[[fault]]\nkind = "offset"\nmessage = "BodyRates"\nsignal = "YawRate"\noffset = 0.5\nunit = "deg/s"\nat_s = 1.0\n'


@pytest.mark.parametrize(
    ("fault", "by", "within_ms", "result"),
    [
        (DROP, "ecu", 500, Result.PASSED),
        (DROP, "bench", 100, Result.PASSED),
        (DROP, "Warnings.InputStale > 0", 500, Result.PASSED),
        (DROP, "ecu", 1, Result.FAILED),
        (DROP, "machine", 1000, Result.FAILED),
        (DROP.replace("BodyRates", "Limits"), "machine", 100, Result.PASSED),
        (DROP.replace("BodyRates", "Limits"), "ecu", 1000, Result.FAILED),
        (QUIETLY, "ecu", 2000, Result.FAILED),
        (QUIETLY, "bench", 2000, Result.FAILED),
        (DROP.replace("at_s = 1.0", "at_s = 10.0"), "ecu", 500, Result.INCONCLUSIVE),
    ],
)
def test_who_detected_a_fault_and_when(tmp_path, fault, by, within_ms, result):
    expected = f'[[expect]]\nkind = "detected"\nby = "{by}"\nwithin_ms = {within_ms}\n'
    (tmp_path / "drive.toml").write_text(DRIVE + fault + expected)
    choice = Choice(scenario=str(tmp_path / "drive.toml"))
    concluded = conclude("drive", choice, tmp_path / "out", run_lockstep(choice, tmp_path / "out"))
    assert [verdict.result for verdict in concluded.expectations] == [result], concluded.expectations


def test_expectations_of_a_file_are_added(result_of, tmp_path):
    (tmp_path / "more.toml").write_text(TOO_FAST)
    ending, _, out = result_of(GOES_WELL, expect=tmp_path / "more.toml")
    assert ending is Ending.FAILED
    assert len(read_record(out).expectations) == 3


def test_a_run_that_broke_off_is_not_judged(tmp_path):
    choice = Choice(scenario="standstill")
    result = run_lockstep(choice, tmp_path / "r")
    broken = type(result)(Ending.PEER_DIED, "gone", result.record)
    concluded = conclude("r", choice, tmp_path / "r", broken)
    assert (ending_of([concluded], strict=False), concluded.expectations) == (Ending.PEER_DIED, ())
