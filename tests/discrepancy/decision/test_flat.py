"""A parameter whose small changes do nothing has an interval too: as far as the likelihood allows."""

import numpy as np
import pytest

from discrepancy.examine import examine
from discrepancy.model.description import Effect, Model, Parameter
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Recording, signal

STOP_M, SD_M = 0.3, 0.01
TIME_S = np.arange(0.0, 60.0, 0.1)
PUSHED = 0.5 + 0.5 * np.sin(0.7 * TIME_S)


def simulate(window, values, extra):
    """A slide that follows a push up to its stop; a stop below 0.2 m shuts it altogether."""
    stop = 1.0 - values["nearer"]
    return {"place": np.minimum(window["push"], stop if stop >= 0.2 else 0.0)}


MODEL = Model(
    name="slide",
    sentence="a slide",
    inputs={"push": "m"},
    outputs={"place": "m"},
    nuisances=(),
    effects=(
        Effect(
            name="nearer stop",
            sentence="the stop is nearer",
            equation="x <= 1 - d",
            parameters=(
                Parameter(name="nearer", unit="m", lower=0.0, upper=1.0, typical=0.5, trial_steps=(0.5, 0.9)),
            ),
            kind="physics",
            place="stop",
        ),
    ),
    simulate=simulate,
    step_s=0.1,
    window_s=10.0,
)


def recorded(stop: float) -> Recording:
    noise = SD_M * np.random.default_rng(4).normal(size=TIME_S.size)
    place = np.minimum(PUSHED, stop) + noise
    return Recording("slide", {"push": signal(TIME_S, PUSHED, "m"), "place": signal(TIME_S, place, "m")})


def test_a_saturated_parameter_is_known_only_as_far_as_it_saturates() -> None:
    """Whatever shuts the slide is above 0.8 m; nothing says how far above."""
    found = examine(MODEL, [recorded(0.0)], Settings(open_ended=False))
    (estimate,) = found.finding("nearer stop").parameters
    assert found.named == ["nearer stop"]
    assert estimate.low == pytest.approx(0.8, abs=0.02)
    assert estimate.high == 1.0
    assert estimate.low <= estimate.value <= estimate.high


def test_a_parameter_that_shows_has_a_narrow_interval_about_the_truth() -> None:
    found = examine(MODEL, [recorded(STOP_M)], Settings(open_ended=False))
    (estimate,) = found.finding("nearer stop").parameters
    assert estimate.low < 1.0 - STOP_M < estimate.high
    assert estimate.high - estimate.low < 0.01
