"""Two runs: equal ones pass, each kind of difference is named, tolerances are kept to the digit."""

import json
from dataclasses import replace

import numpy as np
import pytest

from configuration.table import ConfigurationError
from dbc import loader_database
from hil.rundir import RunDirectory
from hil.verdict import Result
from testbench.api import Bench, blocking
from testbench.compare.compare import Kind, changes, compare, numbers
from testbench.compare.tolerances import Tolerances
from testbench.expect.signals import Series, find_signal
from tests.conftest import STANDS

FRONT = find_signal("NormalForces.FrontLeft", loader_database())
STATE = find_signal("EcuStatus.State", loader_database())
TIME = np.arange(0.0, 10.0, 0.01)


def series(values):
    return Series(TIME, np.asarray(values, float))


def test_the_root_mean_square_decides_at_the_tolerance():
    wave = 30 + 10 * np.sin(TIME)
    for beyond, result in ((-1e-9, Result.PASSED), (1e-9, Result.FAILED)):
        shifted = series(wave + 0.5 + beyond)
        assert numbers(FRONT, series(wave), shifted, Tolerances(signals={FRONT.name: 0.5})).result is result


def test_the_default_is_a_share_of_what_the_signal_spans():
    wave = 30 + 10 * np.sin(TIME)
    assert numbers(FRONT, series(wave), series(wave + 0.3), Tolerances()).result is Result.PASSED  # of 0.4
    assert numbers(FRONT, series(wave), series(wave + 0.5), Tolerances()).result is Result.FAILED


def test_samples_that_are_missing_in_one_run_are_a_difference():
    gone = np.full(TIME.size, 30.0)
    gone[:200] = np.nan
    found = numbers(FRONT, series(np.full(TIME.size, 30.0)), series(gone), Tolerances())
    assert found.result is Result.FAILED
    assert "100.0 % and 80.0 %" in found.reason


def test_a_constant_may_differ_by_two_steps_of_its_signal():
    level = np.full(TIME.size, 30.0)
    assert numbers(FRONT, series(level), series(level + 0.08), Tolerances()).result is Result.PASSED
    assert numbers(FRONT, series(level), series(level + 0.12), Tolerances()).result is Result.FAILED


def stepping(at_s, *, flicker_s=None):
    values = np.where(at_s - 1e-9 <= TIME, 2.0, 1.0)
    if flicker_s is not None:
        values[(flicker_s <= TIME) & (flicker_s + 0.02 > TIME)] = 3.0
    return series(values)


def test_moments_of_change_decide_at_the_tolerance():
    tolerances = Tolerances()
    for at_s, result in ((5.05, Result.PASSED), (5.06, Result.FAILED)):
        found = changes(Kind.STATE, STATE, stepping(5.0), stepping(at_s), tolerances.moment_s)
        assert found.result is result, found.reason


def test_flicker_is_passed_over_and_another_state_is_named():
    assert (
        changes(Kind.STATE, STATE, stepping(5.0), stepping(5.0, flicker_s=2.0), 0.05).result is Result.PASSED
    )
    found = changes(Kind.STATE, STATE, stepping(5.0), series(np.ones(TIME.size)), 0.05)
    assert found.reason == "change 2: degraded at 5.00 s and nothing more"


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A run of one second, the same again, and one with a stuck gyro."""
    folder = tmp_path_factory.mktemp("compare")
    (folder / "short.toml").write_text(STANDS.format(duration_s=2.0))
    for name, stuck in (("one", False), ("again", False), ("stuck", True)):
        with blocking(Bench.lockstep(folder / "short.toml", keep=folder / name)) as bench:
            bench.run_for(0.5)
            if stuck:
                bench.stimulate("BodyRates.RollRate", 160.0)
            bench.run_for(0.5)
    return folder


@pytest.mark.timeout(600)
def test_equal_runs_are_equal_in_everything(kept):
    found = compare(RunDirectory.read(kept / "one"), RunDirectory.read(kept / "again"), Tolerances(share=0.0))
    assert {each.result for each in found} == {Result.PASSED}
    assert {each.kind for each in found} == set(Kind)


@pytest.mark.timeout(600)
def test_a_run_without_an_optional_message_lacks_nothing(kept):
    """As one that was recorded before the message existed; a message that has to be there is a difference."""
    whole = RunDirectory.read(kept / "one")
    for name, result in (("EstimateUncertainty", Result.PASSED), ("NormalForces", Result.FAILED)):
        less = replace(whole, messages={n: c for n, c in whole.messages.items() if n != name})
        for pair in ((whole, less), (less, whole)):
            assert next(d for d in compare(*pair, Tolerances()) if d.name == name).result is result


def test_a_stuck_sensor_is_a_difference_of_state_and_warning(kept):
    found = compare(RunDirectory.read(kept / "one"), RunDirectory.read(kept / "stuck"), Tolerances())
    different = {each.name: each for each in found if each.result is Result.FAILED}
    assert "degraded at 0.5" in different["EcuStatus.State"].reason
    assert different["Warnings.InputImplausible"].kind is Kind.WARNING


@pytest.mark.timeout(600)
def test_the_command_has_exit_codes_results_and_a_page(kept, capsys):
    from loaderhil.cli import app

    for other, code in (("again", 0), ("stuck", 1)):
        words = ["compare", str(kept / "one"), str(kept / other), "--out", str(kept / "c.html"), "--json"]
        with pytest.raises(SystemExit) as ended:
            app([*words, "--junit", str(kept / "c.xml")])
        assert ended.value.code == code
        assert json.loads(capsys.readouterr().out)["exit_code"] == code
    page = (kept / "c.html").read_text()
    assert "What differs" in page
    assert '<path class="predicted"' in page
    assert "<failure" in (kept / "c.xml").read_text()


def test_a_tolerance_for_a_signal_that_is_none_names_the_near_one(tmp_path):
    file = tmp_path / "t.toml"
    file.write_text('[signals]\n"NormalForces.FrontLef" = 1.0\n')
    with pytest.raises(ConfigurationError, match="did you mean 'FrontLeft'"):
        Tolerances.from_file(file, loader_database())
    file.write_text('percent = 5\n[signals]\n"NormalForces.FrontLeft" = 1.0\n')
    assert Tolerances.from_file(file, loader_database()).signals == {"NormalForces.FrontLeft": 1.0}
