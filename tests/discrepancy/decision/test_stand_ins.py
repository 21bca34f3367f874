"""A wrong value of the baseline, or an effect in its place."""

from dataclasses import replace

import pytest

from discrepancy.examine import examine
from discrepancy.model.description import Model
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import BaselineValue, Findings
from tests.discrepancy.room import SHEET, evening, room
from tests.discrepancy.toys import record, tank


def with_wrong_area(model: Model) -> Model:
    """The sheet says 1.3 to 2 %, the tank of the recordings has 1."""
    area, level = model.nuisances
    return replace(model, nuisances=(replace(area, value=1.3, prior_sd=0.026), level))


def verdict(model: Model, seed: int) -> tuple[Findings, BaselineValue]:
    result = examine(model, [record(seed)], Settings())
    (value,) = result.baseline_values
    return result, value


@pytest.mark.parametrize("seed", [20, 21, 22])
def test_a_level_that_reads_low_fills_as_a_wider_tank_does(seed: int) -> None:
    """A level that reads s times too much obeys the law of a tank with the area over s. Inflow and level cannot distinguish the two."""
    result, area = verdict(with_wrong_area(tank("leak", "level bias", "level scale")), seed)
    assert (area.sure, area.or_effects) == (False, ["level scale"])
    assert (result.status, result.named) == ("inconclusive", [])
    assert result.reasons[0].startswith("either the baseline's area is ")
    assert result.reasons[0].endswith("cannot distinguish from it: level scale")


def test_an_effect_that_cannot_be_so_large_does_not_act_in_its_place() -> None:
    """The area is off by 30 %. A gauge that is good to 5 % does not do that."""
    model = with_wrong_area(tank("leak", "level scale"))
    leak, scale = model.effects
    [size] = scale.parameters
    good = replace(scale, parameters=(replace(size, lower=-0.05, upper=0.05),))
    result, area = verdict(replace(model, effects=(leak, good)), 20)
    assert (area.sure, area.or_effects, result.status) == (True, [], "explained")


@pytest.mark.parametrize("seed", [20, 21, 22])
def test_effects_of_another_shape_leave_the_value_alone(seed: int) -> None:
    result, area = verdict(with_wrong_area(tank("leak", "level bias")), seed)
    assert (area.sure, area.or_effects, result.status) == (True, [], "explained")


def test_one_effect_behind_several_wrong_values_is_said_once() -> None:
    """A heater that gives 0.83 of its power: capacity and losses are all 1.2 times as large, four standard deviations.

    Recorded by a thermometer that reads 1 K too much: beside a finding the search goes on without the sheet's pull. With one of the values at the edge
    of its sheet the others have to go there too, which costs them more than a likelihood ratio of 100.
    """
    result = examine(room("weak heater"), [evening(1, weak=0.17, bias=1.0)], Settings(open_ended=False))
    assert [v.or_effects for v in result.baseline_values] == [["weak heater"]] * len(SHEET)
    assert not any(v.sure for v in result.baseline_values)
    assert (result.status, result.named) == ("explained in part", ["temperature bias"])
    [said] = [r for r in result.reasons if r.startswith("either 4 values of the baseline are wrong (")]
    assert said.endswith("weak heater")
    [weak] = [c for c in result.candidates if c.effect == "weak heater"]
    assert weak.verdict == "could not be judged"
    assert "capacity" in weak.reason
