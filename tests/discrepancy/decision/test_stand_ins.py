"""A wrong value of the baseline, or an effect in its place."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.examine import examine
from discrepancy.model.description import Effect, Model, Parameter, Window
from discrepancy.model.sensors import sensor_effects
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import BaselineValue, Findings
from discrepancy.signals.recording import Array, Recording, signal
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


SHEET = {
    "capacity": ("J/K", 3e4),
    "loss": ("W/K", 60.0),
    "vent": ("W/K", 80.0),
    "draught": ("W.s/(K.m)", 20.0),
}
STEP_S = 10.0


def warmed(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    """C dx/dt = (1 - weak) P - (loss + vent opening + draught wind) x, exact for what is held over a step."""
    lost = values["loss"] + values["vent"] * window["opening"] + values["draught"] * window["wind"]
    power = (1.0 - values.get("weak", 0.0)) * window["heater"]
    kept = np.exp(-lost / values["capacity"] * window.step_s)
    now, found = values["warm"], []
    for share, steady in zip(kept.tolist(), (power / lost).tolist(), strict=True):
        found.append(now)
        now = steady + share * (now - steady)
    return {"temperature": np.array(found)}


def room() -> Model:
    """A room whose heater may be weak, which is a larger capacity and larger losses, all by one factor."""
    known = [
        Parameter(name=name, unit=unit, value=value, lower=0.1 * value, upper=10.0 * value, typical=0.05 * value, prior_sd=0.05 * value)
        for name, (unit, value) in SHEET.items()
    ]  # fmt: skip
    weak = Effect(
        name="weak heater",
        sentence="the heater gives less than it should",
        equation="",
        parameters=(Parameter(name="weak", unit="1", lower=0.0, upper=0.9, typical=0.1),),
        kind="physics",
        place="heater",
    )
    warm = Parameter(
        name="warm", unit="K", typical=1.0, scope="window", guess=lambda w: w.at_start("temperature")
    )
    return Model(
        name="room",
        sentence="a room",
        inputs={"heater": "W", "opening": "1", "wind": "m/s"},
        held=("heater", "opening", "wind"),
        outputs={"temperature": "K"},
        nuisances=(*known, warm),
        effects=(weak, *sensor_effects("temperature", "K", bias=1.0, kinds=("bias", "delay"))),
        simulate=warmed,
        step_s=STEP_S,
        window_s=1200.0,
    )


def an_evening(weak: float) -> Recording:
    """Recorded by a thermometer that reads 1 K too much: beside a finding the search goes on without the sheet's pull."""
    rng, n = np.random.default_rng(1), 1440
    time_s = STEP_S * np.arange(n)

    def steps(low: float, high: float, every: int) -> Array:
        return np.repeat(rng.uniform(low, high, n // every + 1), every)[:n]

    signals = {
        "heater": signal(time_s, steps(0.0, 2000.0, 30), "W", held=True),
        "opening": signal(time_s, steps(0.0, 1.0, 47), "1", held=True),
        "wind": signal(time_s, steps(0.0, 5.0, 22), "m/s", held=True),
    }
    whole = Window(
        recording="evening",
        start_s=0.0,
        end_s=float(time_s[-1]),
        time_s=time_s,
        step_s=STEP_S,
        known={name: s.value for name, s in signals.items()},
        constants={},
    )
    sheet = {name: value for name, (_, value) in SHEET.items()}
    true = warmed(whole, {**sheet, "weak": weak, "warm": 8.0}, {})["temperature"]
    signals["temperature"] = signal(time_s, true + 1.0 + 0.05 * rng.normal(size=n), "K")
    return Recording("evening", signals)


def test_one_effect_behind_several_wrong_values_is_said_once() -> None:
    """A heater that gives 0.83 of its power: capacity and losses are all 1.2 times as large, four standard deviations.

    With one of them at the edge of its sheet the others have to go there too, which costs them more than a likelihood ratio of 100.
    """
    result = examine(room(), [an_evening(weak=0.17)], Settings(open_ended=False))
    assert [v.or_effects for v in result.baseline_values] == [["weak heater"]] * len(SHEET)
    assert not any(v.sure for v in result.baseline_values)
    assert (result.status, result.named) == ("explained in part", ["temperature bias"])
    [said] = [r for r in result.reasons if r.startswith("either 4 values of the baseline are wrong (")]
    assert said.endswith("weak heater")
    [weak] = [c for c in result.candidates if c.effect == "weak heater"]
    assert weak.verdict == "could not be judged"
    assert "capacity" in weak.reason
