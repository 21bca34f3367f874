"""Sizes at the rate of the recording and at that of the model."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.judgement import Judgement
from discrepancy.decision.rates import at_both_rates, at_models_rate
from discrepancy.decision.summary import estimate
from discrepancy.examine import investigate
from discrepancy.selection.bandwidth import OVERSAMPLED
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Recording, signal
from tests.discrepancy.toys import record, tank

STRICT = Settings()
RATES = "not right at every frequency"


def fast(seed: int) -> Recording:
    """A leaking tank read every 10 ms."""
    slow = record(seed, noise=0.0, leak=0.05)
    time_s = np.arange(0.0, 119.0, 0.01)
    level = np.interp(time_s, slow.signals["level"].time_s, slow.signals["level"].value)
    seen = level + np.random.default_rng(seed).normal(0.0, 0.02, time_s.size)
    return Recording("fast", {**slow.signals, "level": signal(time_s, seen, "m")})


def judged(recording: Recording, settings: Settings) -> Judgement:
    found = investigate(tank("leak"), [recording], settings)
    assert isinstance(found, Judgement)
    return found


@pytest.mark.parametrize("seed", range(4))
def test_sizes_of_a_right_model_agree(seed: int) -> None:
    found = judged(fast(seed), STRICT)
    slow = at_models_rate(found.problem, found.state, STRICT)
    assert slow is not None
    assert slow.samples >= OVERSAMPLED
    assert not any(RATES in reason for reason in found.findings.reasons)


@pytest.mark.parametrize("seed", range(2))
def test_wrong_readings_are_in_no_mean_either(seed: int) -> None:
    """One in 500 readings is 2 m off. In means of 8 or more that would be an error of 0.2 m, ten times the noise."""
    good = fast(seed)
    level = good.signals["level"]
    value, rng = level.value.copy(), np.random.default_rng([seed, 1])
    value[rng.choice(value.size, value.size // 500, replace=False)] += 2.0
    found = judged(replace(good, signals={**good.signals, "level": replace(level, value=value)}), STRICT)
    assert sum(int(out.sum()) for out in found.state.aside.rows) > 10
    slow = at_models_rate(found.problem, found.state, STRICT)
    assert slow is not None
    clean = judged(good, STRICT)
    plain = at_models_rate(clean.problem, clean.state, STRICT)
    assert plain is not None
    here, there = slow.fit.values.shared["leak"], plain.fit.values.shared["leak"]
    assert abs(here - there) < 1.5 * plain.fit.sd("leak")
    assert slow.fit.sd("leak") < 1.5 * plain.fit.sd("leak")
    assert not any(RATES in reason for reason in found.findings.reasons)


@pytest.mark.parametrize(("apart", "contradict"), [(0.5, False), (2.0, True), (-2.0, True)])
def test_the_interval_holds_the_sizes_at_both_rates(apart: float, contradict: bool) -> None:
    """The size at the model's rate is moved by so many of its standard deviations.

    Means lose hardly any information here, so two of them are many of the difference; were the two fits of different data, they would be 1.4.
    """
    found = judged(fast(1), STRICT)
    slow = at_models_rate(found.problem, found.state, STRICT)
    assert slow is not None
    here = found.findings.finding("leak").parameters[0]
    spread = estimate(found.problem.model.parameter("leak"), slow.fit, slow.noise)
    assert spread.high is not None
    there = here.value + apart * (spread.high - spread.value) / 1.96
    moved = replace(slow, fit=replace(slow.fit, values=slow.fit.values.having(leak=there)))
    [leak], said = at_both_rates(found.problem, found.state, found.findings.findings, moved)
    [size] = leak.parameters
    assert size.value == here.value
    assert size.low is not None
    assert size.high is not None
    assert here.low is not None
    assert here.high is not None
    # both, whether they contradict each other or not: near the limit the last digits decide
    assert size.low <= min(here.low, there) < max(here.high, there) <= size.high
    assert [RATES in sentence for sentence in said] == ([True] if contradict else [])


def test_a_recording_at_the_models_rate_is_fitted_once() -> None:
    found = judged(record(1, leak=0.05), STRICT)
    assert at_models_rate(found.problem, found.state, STRICT) is None
    averaged = judged(fast(1), replace(STRICT, average=True))
    assert at_models_rate(averaged.problem, averaged.state, STRICT) is None
