"""A wrong value of the baseline, or an effect in its place."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

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


def heated(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    """C dx/dt = (1 - weak) P - k x."""
    power = (1.0 - values.get("weak", 0.0)) * window["heater"]
    rate = values["loss"] / values["capacity"]
    kept = np.exp(-rate * window.step_s)
    warm = lfilter([0.0, (1.0 - kept) / values["loss"]], [1.0, -kept], power, zi=[values["warm"]])[0]
    return {"temperature": warm}


def room() -> Model:
    """A room whose heater may be weak, which is a larger capacity and a larger loss."""
    known = [
        Parameter(name=name, unit=unit, value=value, lower=0.1 * value, upper=10.0 * value, typical=0.05 * value, prior_sd=0.05 * value)
        for name, unit, value in (("capacity", "J/K", 3e4), ("loss", "W/K", 100.0))
    ]  # fmt: skip
    weak = Effect(
        name="weak heater",
        sentence="the heater gives less than it should",
        equation="",
        parameters=(Parameter(name="weak", unit="1", lower=0.0, upper=0.9, typical=0.1),),
        kind="physics",
        place="heater",
    )
    return Model(
        name="room",
        sentence="a room",
        inputs={"heater": "W"},
        held=("heater",),
        outputs={"temperature": "K"},
        nuisances=(
            *known,
            Parameter(name="warm", unit="K", typical=1.0, scope="window", guess=lambda w: w.at_start("temperature")),
        ),
        effects=(weak, *sensor_effects("temperature", "K", bias=1.0, kinds=("bias", "delay"))),
        simulate=heated,
        step_s=10.0,
        window_s=1200.0,
    )  # fmt: skip


def an_evening(weak: float) -> Recording:
    rng, n = np.random.default_rng(1), 1440
    power = np.repeat(rng.uniform(0.0, 2000.0, n // 30 + 1), 30)[:n]
    kept = np.exp(-100.0 / 3e4 * 10.0)
    warm = lfilter([0.0, (1.0 - kept) / 100.0], [1.0, -kept], (1.0 - weak) * power, zi=[8.0])[0]
    time_s = 10.0 * np.arange(n)
    return Recording(
        "evening",
        {
            "heater": signal(time_s, power, "W", held=True),
            "temperature": signal(time_s, warm + 0.05 * rng.normal(size=n), "K"),
        },
    )


def test_one_effect_behind_several_wrong_values_is_said_once() -> None:
    """A heater that gives 0.7 of its power: capacity and loss are both 1.43 times as large, and neither can return alone."""
    result = examine(room(), [an_evening(weak=0.3)], Settings(open_ended=False))
    assert [v.or_effects for v in result.baseline_values] == [["weak heater"], ["weak heater"]]
    assert not any(v.sure for v in result.baseline_values)
    assert result.reasons[0].startswith("either 2 values of the baseline are wrong (")
    assert result.reasons[0].endswith("weak heater")
    [weak] = [c for c in result.candidates if c.effect == "weak heater"]
    assert weak.verdict == "could not be judged"
    assert "capacity" in weak.reason
