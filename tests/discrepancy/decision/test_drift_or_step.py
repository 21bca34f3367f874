"""A drift is a name only where a step of the same sensor is none."""

from collections.abc import Mapping

import numpy as np
import pytest

from discrepancy.examine import examine
from discrepancy.model import Array, Model, Parameter, Recording, Window, sensor_effects, signal
from discrepancy.selection.state import Settings

LENGTH_S, WINDOWS = 600.0, 6  # too few windows to look for effects that act for a part of the time
SETTINGS = Settings(open_ended=False)


def heated(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
    """A plate that is as hot as its heater makes it."""
    return {"temperature": values["resistance"] * window["heat"]}


def plate() -> Model:
    resistance = Parameter(name="resistance", unit="K/W", value=2.0, typical=0.05, prior_sd=0.2)
    return Model(name="plate", sentence="", inputs={"heat": "W"}, outputs={"temperature": "K"}, nuisances=(resistance,),
                 effects=sensor_effects("temperature", "K", bias=0.1, kinds=("bias", "scale", "drift")),
                 simulate=heated, step_s=0.5, window_s=LENGTH_S / WINDOWS)  # fmt: skip


def measured(seed: int, off: Array, time_s: Array) -> Recording:
    rng = np.random.default_rng(seed)
    heat = np.repeat(rng.uniform(5.0, 15.0, 60), time_s.size // 60)
    seen = 2.0 * heat + off + rng.normal(0.0, 0.5, time_s.size)
    return Recording("day", {"heat": signal(time_s, heat, "W"), "temperature": signal(time_s, seen, "K")})


TIME_S = 0.5 * np.arange(1200)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("at_s", [250.0, 350.0])
def test_a_sensor_that_is_off_from_a_time_on_does_not_drift(seed: int, at_s: float) -> None:
    """The step lies within a window, so that none at the edge of one is quite right."""
    result = examine(plate(), [measured(seed, 0.4 * (at_s < TIME_S), TIME_S)], SETTINGS)
    drift = result.finding("temperature drift")
    assert not drift.named
    [said] = drift.caveats
    assert said.startswith("temperature off by 0.")
    assert said.endswith(("explains the recordings as well", "explains the recordings better"))
    assert result.named == []


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_that_drifts_keeps_its_name(seed: int) -> None:
    result = examine(plate(), [measured(seed, 2e-3 * TIME_S, TIME_S)], SETTINGS)
    assert result.named == ["temperature drift"]
    [rate] = result.finding("temperature drift").parameters
    assert rate.low is not None
    assert rate.high is not None
    assert rate.low <= 2e-3 <= rate.high


def test_a_drift_that_is_hardly_seen_may_be_a_step() -> None:
    """Of a ramp, the best step explains three quarters: of little evidence, that leaves less than a rival may be worse by."""
    result = examine(plate(), [measured(1, 2.2e-4 * TIME_S, TIME_S)], SETTINGS)
    drift = result.finding("temperature drift")
    assert not drift.named
    assert any(said.endswith("explains the recordings as well") for said in drift.caveats)
