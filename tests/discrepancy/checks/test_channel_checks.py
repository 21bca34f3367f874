"""Zero points and clocks of channels."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.checks.channel_checks import failing_channels
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Model, Parameter
from discrepancy.signals.recording import Recording, signal
from tests.discrepancy.toys import record, tank


def test_a_zero_point_that_is_off_is_no_other_clock() -> None:
    """The level is known at the start, so nothing takes the offset away before prediction and reading are compared."""
    model = tank("level bias")
    area, level = model.nuisances
    known = replace(model, nuisances=(area, replace(level, scope="all", guess=None, value=0.5)))
    for seed in range(1, 7):
        assert failing_channels(Problem(known, [record(seed, bias=-3.0)])) == []
    late = record(2)
    level_late = replace(late.signals["level"], time_s=late.signals["level"].time_s + 9.0)
    shifted = replace(late, signals={**late.signals, "level": level_late})
    (complaint,) = failing_channels(Problem(known, [shifted]))
    assert "another clock" in complaint.text


@pytest.mark.parametrize(("prior_sd", "reported"), [(0.1, 0), (0.001, 1)])
def test_a_zero_error_within_its_prior_is_no_wrong_sign(prior_sd: float, reported: int) -> None:
    """Level 0.035 m predicted, -0.04 m read: opposite constants, as a sensor's zero error makes them on an even drive."""
    model = Model(
        name="level",
        sentence="a level that stays",
        inputs={"inflow": "m/s"},
        outputs={"level": "m"},
        nuisances=(Parameter(name="zero", unit="m", typical=0.1, prior_sd=prior_sd),),
        effects=(),
        simulate=lambda window, values, extra: {"level": np.full(window.time_s.size, 0.035 + values["zero"])},
        step_s=0.1,
    )
    time_s = 0.1 * np.arange(400)
    read = -0.04 + 0.01 * np.random.default_rng(1).normal(size=time_s.size)
    seen = Recording(
        "even", {"inflow": signal(time_s, 0.0 * time_s, "m/s"), "level": signal(time_s, read, "m")}
    )
    complaints = failing_channels(Problem(model, [seen]))
    assert len(complaints) == reported
    assert all("opposite" in c.text for c in complaints)


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_a_channel_that_reads_zero_wherever_it_is_scored_has_no_slope(size: float) -> None:
    """Whatever the model predicts there: a wheel in the air carries exactly nothing."""
    recording = record(3)
    inflow, level = recording.signals["inflow"], recording.signals["level"]
    start, end = float(level.time_s[0]), float(level.time_s[-1])
    half = 0.5 * (start + end)
    silent = {
        "inflow": replace(inflow, value=size * inflow.value),
        "level": replace(level, value=np.where(level.time_s < half, level.value, 0.0)),
    }
    second = replace(tank(), window_s=None, segments=lambda recording, interval: [(half, end)])
    failing_channels(Problem(second, [replace(recording, signals=silent)]))
