"""Adequate first, then a name: errors beside budgets, and the verdicts that follow."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.adequacy import certain
from discrepancy.decision.location import fraction
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.model.sensors import sensor_effects
from discrepancy.selection.state import Settings
from discrepancy.signals.adequacy import ChannelAdequacy, ErrorPart, left
from discrepancy.signals.findings import Findings
from tests.discrepancy.toys import record, struck, tank

QUICK = Settings(open_ended=False)


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_errors_of_a_complete_model_are_within_budget(memory: float) -> None:
    result = examine(tank("leak"), [record(11, memory=memory)], QUICK)
    (level,) = result.adequacy
    assert (result.status, level.adequate) == ("nothing missing", True)
    assert level.one_step == pytest.approx(0.02, rel=0.1)
    assert level.simulated < level.simulated_budget
    assert not any(p.over for p in (*level.parts, *level.regimes))


def test_nothing_missing_needs_adequacy() -> None:
    """What the noise's memory can swallow is still there in the simulation."""
    result = examine(tank("leak", "level delay"), [struck(record(12), 40.0, 60.0, 1.0)], QUICK)
    (level,) = result.adequacy
    assert result.named == []
    assert (result.status, level.adequate) == ("unknown", False)
    assert any(reason.startswith("still wrong: level is simulated to") for reason in result.reasons)


@pytest.mark.parametrize(
    ("leak", "said"),
    [
        (0.0, "without any effect: every channel is within its error budget (1 of 1)"),
        (0.2, "without any effect: 1 of 1 channels beyond their error budgets; level is simulated to"),
    ],
)
def test_an_expensive_model_is_first_said_to_be_good_or_not(leak: float, said: str) -> None:
    """Before its effects are simulated, which takes most of the time."""
    steps: list[str] = []
    model = replace(tank("leak", "level delay"), jacobian_reach=6.0)
    examine(model, [record(12, leak=leak)], QUICK, steps.append)
    screened = next(i for i, step in enumerate(steps) if "screened" in step)
    assert any(step.startswith(said) for step in steps[:screened])


def test_the_time_in_which_the_error_is_left_is_said() -> None:
    result = examine(tank("level sign"), [struck(record(13), 60.0, 72.0, 0.8)], QUICK)
    over = [p for p in result.adequacy[0].parts if p.over]
    assert over
    for part in over:
        assert part.start_s is not None
        assert part.end_s is not None
        assert part.end_s > 59.0
        assert part.start_s < 73.0


def test_explained_needs_adequacy_and_says_how_much_is_left() -> None:
    """A leak with a size that is sure, beside a disturbance that has no name."""
    whole = examine(tank("leak"), [record(14, leak=0.05)], QUICK)
    part = examine(tank("leak"), [struck(record(14, leak=0.05), 90.0, 100.0, 0.8)], QUICK)
    assert (whole.status, whole.adequacy[0].adequate) == ("explained", True)
    assert (part.status, part.named) == ("explained in part", ["leak"])
    assert part.findings[0].parameters[0].value == pytest.approx(0.05, rel=0.1)
    said = next(reason for reason in part.reasons if reason.startswith("still wrong"))
    assert "times its budget" in said
    assert " m, most from 9" in said


def test_a_finding_lowers_the_errors_from_before_to_after() -> None:
    (level,) = examine(tank("leak"), [record(15, leak=0.05)], QUICK).adequacy
    assert level.simulated < 0.2 * level.simulated_before
    assert level.one_step < level.one_step_before
    assert level.one_step == pytest.approx(0.02, rel=0.1)


def test_one_step_errors_beyond_the_sensors_sheet_are_too_much() -> None:
    """Readings with twice the noise of their sheet; the same readings with a measured budget prove nothing."""
    recording = record(16, noise=0.02)
    known = replace(tank("leak"), sensor_noise={"level": 0.01})
    verdicts = [examine(m, [recording], QUICK) for m in (tank("leak"), known)]
    assert [v.status for v in verdicts] == ["nothing missing", "unknown"]
    assert any("is predicted one step ahead to 0.02 m, 2" in reason for reason in verdicts[1].reasons)


def test_disturbances_that_the_model_states_are_allowed() -> None:
    recording = struck(record(17), 60.0, 72.0, 0.8)
    rough = replace(tank("level sign"), disturbances={"level": 0.5})
    assert examine(rough, [recording], QUICK).adequacy[0].adequate


def test_shares_are_between_nothing_and_all() -> None:
    """Noise makes some bins negative; the positive ones are not more than all for that."""
    bins = np.array([-3.0, 4.0, 1.0, -1.5])
    assert fraction(bins[1:2], bins) == pytest.approx(0.8)
    assert fraction(bins[1:], bins) == 1.0
    assert fraction(bins[:1], bins) == 0.0
    assert fraction(bins, -bins[:0]) == 0.0


def test_a_negative_delay_is_called_early() -> None:
    delay = next(e for e in sensor_effects("gyro", "rad/s", bias=0.1) if e.name == "gyro delay")
    assert "comes late" in delay.said(0.07)
    assert "comes early" in delay.said(-0.07)


def test_the_sentence_names_channel_size_budget_and_place() -> None:
    (level,) = examine(tank("leak"), [record(18)], QUICK).adequacy
    part = ErrorPart(
        recording="b", start_s=3.0, end_s=4.0, one_step_before=0.0, one_step=0.0, simulated_before=0.0, simulated=1.0, over=True,
    )  # fmt: skip
    far = replace(level, simulated=0.5, simulated_budget=0.1, parts=[part], adequate=False)
    assert (
        left(far, several=True)
        == "level is simulated to 0.5 m, 5 times its budget of 0.1 m, most from 3.0 to 4.0 s of b"
    )


def test_findings_hold_the_errors_of_every_channel() -> None:
    result: Findings = examine(tank("leak"), [record(19)], QUICK)
    assert [c.channel for c in result.adequacy] == ["level"]


def test_a_wrong_value_of_the_baseline_is_a_finding_with_prior_estimate_and_interval() -> None:
    """The sheet says 1.3 to 2 %, the tank of the recordings has 1."""
    model = tank("leak")
    area, level = model.nuisances
    wrong = replace(model, nuisances=(replace(area, value=1.3, prior_sd=0.026), level))
    result = examine(wrong, [record(20)], QUICK)
    (found,) = result.baseline_values
    assert (found.kind, found.estimate.name, found.estimate.baseline, found.sure) == (
        "parameter",
        "area",
        1.3,
        True,
    )
    assert found.estimate.value == pytest.approx(1.0, abs=0.02)
    assert found.estimate.low is not None
    assert found.estimate.high is not None
    assert found.estimate.low < found.estimate.value < found.estimate.high < 1.1
    assert found.away == pytest.approx((1.3 - found.estimate.value) / 0.026, rel=1e-6)
    assert (result.status, result.named) == ("explained", [])
    assert "the baseline's area is" in result.reasons[0]
    assert "not 1.3" in result.reasons[0]
    assert examine(model, [record(20)], QUICK).baseline_values == []


def test_in_an_inadequate_model_a_value_that_moved_is_not_sure() -> None:
    model = tank("level sign")
    area, level = model.nuisances
    wrong = replace(model, nuisances=(replace(area, value=1.3, prior_sd=0.026), level))
    result = examine(wrong, [struck(record(20), 60.0, 72.0, 2.0)], QUICK)
    assert not any(b.sure for b in result.baseline_values)


@pytest.mark.parametrize("seed", [20, 21, 22])
@pytest.mark.parametrize("prior_sd", [0.026, 0.05])
def test_a_wrong_value_of_the_sheet_costs_no_name(seed: int, prior_sd: float) -> None:
    """The sheet's area is 20 % too large, and the tank leaks. The recording says both; the sheet's pull is in neither."""
    model = tank("leak", "level scale")
    area, level = model.nuisances
    wrong = replace(model, nuisances=(replace(area, value=1.2, prior_sd=prior_sd), level))
    result = examine(wrong, [record(seed, leak=0.05)], QUICK)
    assert (result.status, result.named) == ("explained in part", ["leak"])
    leak = result.finding("leak").parameters[0]
    assert leak.low is not None
    assert leak.high is not None
    assert leak.low < 0.05 < leak.high
    (found,) = result.baseline_values
    assert (found.prior_sd, found.estimate.baseline) == (prior_sd, 1.2)
    assert found.estimate.value == pytest.approx(1.0, abs=0.005)
    # a level that reads 17 % low fills exactly as a tank of another area does
    assert (found.sure, found.or_effects) == (False, ["level scale"])
    assert result.nuisances[0].prior_sd == prior_sd, "as the sheet says it"


def test_in_a_model_that_is_still_wrong_the_sheet_keeps_its_say() -> None:
    """A pump that acts late is not in the library. Without its prior the area would go to 1.69, and the level's bias would be named beside it."""
    model = tank("leak", "level scale", "level bias")
    area, level = model.nuisances
    wrong = replace(model, nuisances=(replace(area, value=1.2, prior_sd=0.026), level))
    result = examine(wrong, [record(21, pump_lag_s=0.6)], QUICK)
    assert result.named == []
    assert not any(b.sure for b in result.baseline_values)
    assert all(b.estimate.value < 1.4 for b in result.baseline_values)


def test_stated_disturbances_also_count_one_step_ahead() -> None:
    """Beside a sheet of 10 mm, 50 mm of waves are stated: 20 mm of noise are then no error of the model."""
    rough = replace(tank("leak"), sensor_noise={"level": 0.01}, disturbances={"level": 0.05})
    assert examine(rough, [record(16, noise=0.02)], QUICK).status == "nothing missing"


def test_an_error_of_a_part_alone_is_given_with_its_size() -> None:
    (level,) = examine(tank("leak"), [record(18)], QUICK).adequacy
    part = ErrorPart(
        regime="inflow above 1 m/s", one_step_before=0.0, one_step=0.0, simulated_before=0.0, simulated=0.3, over=True,
    )  # fmt: skip
    short = replace(level, simulated=0.05, simulated_budget=0.1, regimes=[part], adequate=False)
    assert left(short) == "level is simulated to 0.3 m, 3 times its budget of 0.1 m where inflow above 1 m/s"


def test_a_reading_that_is_set_aside_is_no_error_of_the_model() -> None:
    """Not of the first rows of its block either, which have no past and get the error of the others."""
    recording = record(16, memory=0.8)
    level = recording.signals["level"]
    value = level.value.copy()
    value[300] += 100.0
    spoilt = replace(recording, signals={**recording.signals, "level": replace(level, value=value)})
    whole, without = (examine(tank("leak"), [r], QUICK) for r in (recording, spoilt))
    assert len(without.complaints) == 1
    (right,), (mended,) = whole.adequacy, without.adequacy
    assert mended.one_step == pytest.approx(right.one_step, rel=0.02)
    assert mended.simulated == pytest.approx(right.simulated, rel=0.02)


def test_a_value_is_certain_only_where_the_model_is_as_good_as_a_reading() -> None:
    """A tenth of the movement is granted for disturbances that nobody stated; another law may hide in it."""
    problem = Problem(tank("leak"), [record(1)])
    stated = problem.again(model=replace(problem.model, disturbances={"level": 0.1}))
    for simulated, alone in ((0.019, True), (0.021, False), (0.09, False)):
        level = ChannelAdequacy(
            channel="level", unit="m", budget=0.01, source="sensor sheet", movement=1.0, one_step_budget=0.012, simulated_budget=0.1,
            one_step_before=0.05, one_step=0.01, simulated_before=0.8, simulated=simulated, adequate=True,
        )  # fmt: skip
        assert certain(problem, [level]) is alone
        assert certain(stated, [level])
        # a slow machine seems to stand still under constant commands: that budget may hold its motion
        slow = replace(level, source="standstill", one_step_budget=None, budget=1.0)
        assert certain(problem, [slow]) is alone
        assert not certain(stated, [replace(level, adequate=False)])
