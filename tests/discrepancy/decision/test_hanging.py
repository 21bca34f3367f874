"""A convex law of cooling behind a model with a linear one: neither a bias of the thermometer nor a wrong sheet."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.caveats import hangs_on
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.model.description import Effect, Model, Parameter, Port, Window
from discrepancy.model.sensors import sensor_effects
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import BaselineValue, Estimate, Findings
from discrepancy.signals.recording import Array, Recording, signal

STEP_S, CAPACITY, LOSS = 1.0, 80.0, 0.6


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    loss = values["loss"] + values.get("dirt", 0.0)
    now, found = values["start"], []
    kept = np.exp(-loss * window.step_s / CAPACITY)  # exact for what is held over a step
    for heat, ambient, more in zip(
        window["heat"],
        window["ambient"],
        extra.get("heat", np.zeros(window.time_s.size)),
        strict=True,
    ):
        found.append(now)
        rest = ambient + (heat + more) / loss
        now = rest + kept * (now - rest)
    return {"temperature": np.array(found)}


def body() -> Model:
    return Model(
        name="body",
        sentence="a heated body in air",
        inputs={"heat": "W", "ambient": "K"},
        held=("heat",),
        outputs={"temperature": "K"},
        nuisances=(
            Parameter(name="loss", unit="W/K", value=LOSS, lower=0.1, upper=3.0, typical=0.05, prior_sd=0.03),
            Parameter(
                name="start", unit="K", typical=0.5, scope="window", guess=lambda w: w.at_start("temperature")
            ),
        ),
        effects=(
            Effect(
                name="dirt",
                sentence="dirt keeps the heat in",
                equation="",
                parameters=(Parameter(name="dirt", unit="W/K", lower=-0.3, upper=0.0, typical=0.1),),
                kind="physics",
                place="surface",
            ),
            *sensor_effects("temperature", "K", bias=0.3, kinds=("bias", "lag"), delay_s=3.0),
        ),
        simulate=simulate,
        step_s=STEP_S,
        window_s=300.0,
        ports=(Port(name="heat", unit="W", typical=5.0, sentence="heat beyond the heater's"),),
    )


def verdict(seed: int, *, convex: bool = False, loss: float = LOSS, bias: float = 0.0) -> Findings:
    """What is said of an hour."""
    return examine(body(), [an_hour(seed, convex=convex, loss=loss, bias=bias)], Settings())


def an_hour(seed: int, *, convex: bool = False, loss: float = LOSS, bias: float = 0.0) -> Recording:
    """An hour in which heater and air change; the truth at a tenth of the model's step."""
    rng = np.random.default_rng(seed)
    n, fine = 3600, 10
    heat = np.repeat(rng.uniform(0.0, 60.0, n // 90), 90)
    ambient = 293.0 + 3.0 * np.sin(np.arange(n) / 700.0 + rng.uniform(0.0, 6.0))
    now, seen = 300.0, np.empty(n)
    for k in range(n):
        seen[k] = now
        for _ in range(fine):
            warmer = now - ambient[k]
            # both take the same heat at 15 K
            law = 0.28 * warmer * np.abs(warmer) ** 0.3 if convex else loss * warmer
            now += STEP_S / fine / CAPACITY * (heat[k] - law)
    time_s = STEP_S * np.arange(n)
    signals = {
        "heat": signal(time_s, heat, "W", held=True),
        "ambient": signal(time_s, ambient, "K"),
        "temperature": signal(time_s, seen + bias + rng.normal(0.0, 0.05, n), "K"),
    }
    return Recording("hour", signals)


@pytest.mark.parametrize("seed", range(4))
def test_a_convex_law_is_no_bias(seed: int) -> None:
    result = verdict(seed, convex=True)
    assert "temperature bias" not in result.named
    assert not [value for value in result.baseline_values if value.sure]


@pytest.mark.parametrize("seed", range(3))
def test_a_bias_is_still_one(seed: int) -> None:
    """By a right sheet, and beside one that is a quarter off: nothing is left beside the two."""
    for loss in (LOSS, 1.25 * LOSS):
        result = verdict(seed, loss=loss, bias=0.5)
        assert result.named == ["temperature bias"]
        [size] = result.findings[0].parameters
        assert size.value == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(("per_loss", "hangs"), [(2.0, False), (20.0, True)])
def test_an_effect_hangs_on_a_value_with_which_it_would_be_another(per_loss: float, hangs: bool) -> None:
    """A bias of 0.5 K beside a loss that was pushed from 0.6 to 0.75 W/K: at 0.66, the edge of its sheet, it changes by per_loss times 0.09 W/K."""
    problem = Problem(body(), [an_hour(0)])
    effect = problem.model.effect("temperature bias")
    start = problem.start()
    values = start.with_shared({"loss": 0.75, "temperature.bias": 0.5})
    # the covariance in which the bias goes with the loss at that rate
    covariance = np.array([[1e-6, per_loss * 1e-6], [per_loss * 1e-6, 1.0 + per_loss**2 * 1e-6]])
    nothing = np.zeros((1, 2))
    fitted = Fit(
        ("loss", "temperature.bias"), values, 0.0, 0.0, nothing[:, 0], nothing, np.linalg.inv(covariance)
    )
    contradicting = BaselineValue(
        estimate=Estimate(name="loss", value=0.75, low=0.74, high=0.76, unit="W/K", baseline=0.6),
        prior_sd=0.03,
        away=5.0,
        sure=True,
    )
    assert bool(hangs_on([contradicting], problem, effect, fitted)) is hangs
    assert not hangs_on([replace(contradicting, away=2.0)], problem, effect, fitted)
