"""Sizes at the rate of the recording, and at that of the model: an interval that holds at one rate only is none.

One-step errors weigh every frequency by its noise (ADR 27). If the model is right at all of them, rows at its own bandwidth give the same sizes with
a little more scatter. If not, the two differ by more than that, and the data do not say which of them is the machine's (Hausman 1978).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from discrepancy import gates
from discrepancy.decision.summary import estimate
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem
from discrepancy.estimation.set_aside import SetAside
from discrepancy.selection.assess import assess
from discrepancy.selection.bandwidth import OVERSAMPLED, at_bandwidth
from discrepancy.selection.state import Settings, State
from discrepancy.signals.findings import Estimate, Finding
from discrepancy.signals.quantities import quantity

LEAST_APART: Final = (
    0.5  # scatter of the difference over that at the model's rate: both variances are known to a half only
)


@dataclass(frozen=True, slots=True)
class AtModelsRate:
    """The accepted effects fitted to rows that come no faster than the model moves."""

    samples: int  # to a row, at most
    fit: Fit
    noise: Noise


def at_models_rate(problem: Problem, state: State, settings: Settings) -> AtModelsRate | None:
    """That fit; None if nothing was accepted, or no channel is sampled far faster than the model moves."""
    if not state.accepted or problem.row_period_s:
        return None
    slow, _ = at_bandwidth(problem)
    samples = max((block.averaged for block in slow.blocks), default=1)
    if samples < OVERSAMPLED:
        return None
    found = assess(slow, state.accepted, state.fit.values, settings, _of_rows(state.aside, slow))
    return AtModelsRate(samples, found.fit, found.noise)


def _of_rows(aside: SetAside, slow: Problem) -> SetAside:
    """What was set aside, for rows of several samples: a row that holds such a reading is out too."""
    if not aside.rows:
        return aside
    rows = [
        out[: out.size - out.size % block.averaged].reshape(-1, block.averaged).max(axis=1)
        for out, block in zip(aside.rows, slow.blocks, strict=True)
    ]
    return SetAside(tuple(rows), aside.intervals)


def at_both_rates(
    problem: Problem, state: State, found: Sequence[Finding], slow: AtModelsRate | None
) -> tuple[list[Finding], list[str]]:
    """The findings with intervals that hold the sizes at both rates, and a sentence on each size where the two contradict each other."""
    if slow is None:
        return [*found], []
    widened, said = [], []
    for finding in found:
        parameters = []
        for here in finding.parameters:
            there = _at_models_rate(problem, state, here, slow)
            if there is not None and _contradict(here, there):
                said.append(
                    f"{here.name} is {quantity(here.value, here.unit)} by single samples and {quantity(there.value, there.unit)} by means of {slow.samples}: "
                    "the model is not right at every frequency of the recording, and the interval holds both"
                )
            # not only where they contradict each other: whether they do hangs on the last digits, and a right model has both in one place
            parameters.append(here if there is None else _both(here, there))
        widened.append(replace(finding, parameters=parameters))
    return widened, said


def _at_models_rate(problem: Problem, state: State, here: Estimate, slow: AtModelsRate) -> Estimate | None:
    """The estimate of the same parameter at the model's rate; None for one without an interval, or of a rival that was not fitted there."""
    if here.low is None or here.name not in slow.fit.names or here.name not in state.fit.names:
        return None
    return estimate(problem.model.parameter(here.name), slow.fit, slow.noise)


def _contradict(here: Estimate, there: Estimate) -> bool:
    """Whether two estimates are further apart than their scatter."""
    # both are of the same data: of an efficient and a less efficient estimate, the variance of the difference is the difference of the variances
    scatter = np.sqrt(max(_sd(there) ** 2 - _sd(here) ** 2, (LEAST_APART * _sd(there)) ** 2))
    return bool(abs(here.value - there.value) > gates.RATES_AGREE.threshold * scatter)


def _ends(e: Estimate) -> tuple[float, float]:
    return (-np.inf if e.low is None else e.low), (np.inf if e.high is None else e.high)


def _sd(e: Estimate) -> float:
    """The standard deviation of which the 95 % interval has 1.96 to the side that no bound cuts."""
    low, high = _ends(e)
    return max(e.value - low, high - e.value) / 1.96


def _both(one: Estimate, other: Estimate) -> Estimate:
    (low, high), (also_low, also_high) = _ends(one), _ends(other)
    return replace(one, low=min(low, also_low), high=max(high, also_high))
