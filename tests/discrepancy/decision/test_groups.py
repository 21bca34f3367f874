"""Rivals that no recording distinguishes are one group, whatever nuisances stand beside them."""

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from discrepancy.decision import groups
from discrepancy.decision.caveats import caveats_of
from discrepancy.decision.drop_one import drop_one_tests
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.model import Array, Effect, Model, Parameter, Recording, Window, sensor_effects, signal
from discrepancy.selection.assess import assess
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.state import Settings
from tests.discrepancy.toys import record, tank

SETTINGS = Settings(open_ended=False)


def share(name: str) -> Effect:
    """A wrong size, in shares of itself."""
    return Effect(
        name=name,
        sentence=f"{name} is not that of the sheet",
        equation="",
        parameters=(Parameter(name=name, unit="1", lower=-0.8, upper=0.8, typical=0.1),),
        kind="physics",
        place="axle",
    )


def robot() -> Model:
    """Yaw rate of two wheels, from the difference of their speeds: track, radius and gyro only show as one factor."""

    def simulate(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
        factor = (1.0 + values.get("radius", 0.0)) / (1.0 + values.get("track", 0.0))
        return {"yaw_rate": factor * (1.0 + values["known_track"]) * window["difference"] / 0.5}

    return Model(
        name="robot",
        sentence="two driven wheels",
        inputs={"difference": "m/s"},
        outputs={"yaw_rate": "rad/s"},
        nuisances=(
            Parameter(name="known_track", unit="1", lower=-0.5, upper=0.5, typical=0.01, prior_sd=0.01),
        ),
        effects=(share("track"), share("radius"), *sensor_effects("yaw_rate", "rad/s", bias=0.05)),
        simulate=simulate,
        step_s=0.05,
        window_s=10.0,
    )


def turning(seed: int, factor: float, noise: float = 0.05) -> Recording:
    rng = np.random.default_rng(seed)
    time_s = 0.05 * np.arange(2400)
    difference = np.repeat(rng.uniform(-0.4, 0.4, 120), 20)
    yaw_rate = factor * difference / 0.5 + rng.normal(0.0, noise, time_s.size)
    signals = {"difference": signal(time_s, difference, "m/s"), "yaw_rate": signal(time_s, yaw_rate, "rad/s")}
    return Recording("day", signals)


@pytest.mark.parametrize("seed", range(3))
def test_track_radius_and_gyro_scale_are_one_group_by_yaw_rate_alone(seed: int) -> None:
    """The track is a nuisance known to 1 % as well, which does nearly the same as each of them."""
    (found,) = examine(robot(), [turning(seed, 0.7)], SETTINGS).findings
    assert {*found.members} == {"track", "radius", "yaw_rate scale"}


def test_what_fits_as_well_is_a_rival_also_where_both_together_would_fit_better(monkeypatch) -> None:
    """As two lags in series do in place of one: which of them is there stays open."""
    monkeypatch.setattr(groups, "_both_needed", lambda *_: True)
    (found,) = examine(robot(), [turning(0, 0.7)], SETTINGS).findings
    assert {*found.members} == {"track", "radius", "yaw_rate scale"}


@pytest.mark.parametrize(
    ("other", "extra", "scatter", "as_well"),
    [
        (109.0, 0.0, 0.0, True),
        (110.0, 0.0, 0.0, False),  # a likelihood ratio of 100 is reached
        (109.0, 2.0, 0.0, False),  # a parameter more has to bring something
        (140.0, 0.0, 25.0, True),  # better at some times and worse at others
        (160.0, 0.0, 25.0, False),
        (
            700.0,
            0.0,
            400.0,
            False,
        ),  # of what the finding explains, a third is too little, however it scatters
        (90.0, 2.0, 0.0, True),
    ],
)
def test_what_explains_as_much_is_a_rival(
    monkeypatch, other: float, extra: float, scatter: float, as_well: bool
) -> None:
    """Beside a finding that takes the SSE from 1000 to 100."""
    monkeypatch.setattr(groups, "difference_sd", lambda *_: scatter)
    without, fitted, rival = (SimpleNamespace(sse=sse) for sse in (1000.0, 100.0, other))
    assert groups.fits_as_well(None, without, fitted, rival, extra, SETTINGS) == as_well


KNOTS = (0.0, 0.1, 0.25, 0.4)  # [m/s]


def with_curve() -> Model:
    """The same robot with a curve over the difference of speeds, of which a constant factor is a special case."""
    plain = robot()
    names = [f"curve.{i}" for i in range(len(KNOTS))]
    curve = Effect(
        name="curve",
        sentence="yaw follows another curve",
        equation="",
        parameters=tuple(Parameter(name=n, unit="1", lower=-0.9, upper=2.0, typical=0.1) for n in names),
        kind="physics",
        place="axle",
    )

    def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
        share = np.interp(np.abs(window["difference"]), KNOTS, [values.get(n, 0.0) for n in names])
        return {"yaw_rate": (1.0 + share) * plain.simulate(window, values, extra)["yaw_rate"]}

    return replace(plain, effects=(share("track"), curve), simulate=simulate)


@pytest.mark.parametrize("seed", range(3))
def test_a_curve_stands_back_behind_a_law_that_it_contains(seed: int) -> None:
    (found,) = examine(with_curve(), [turning(seed, 0.7)], SETTINGS).findings
    assert (found.effect, found.group) == ("track", [])


@pytest.mark.parametrize("seed", range(3))
def test_a_curve_is_the_name_where_no_special_law_does(seed: int) -> None:
    recording = turning(seed, 1.0)
    difference, noisy = recording.signals["difference"], recording.signals["yaw_rate"]
    other = noisy.value * (0.8 + 0.8 * np.abs(difference.value) / 0.4)
    bent = replace(recording, signals={**recording.signals, "yaw_rate": replace(noisy, value=other)})
    (found,) = examine(with_curve(), [bent], SETTINGS).findings
    assert (found.effect, found.group) == ("curve", [])


def test_exact_twins_are_a_group_beside_a_nuisance_that_does_the_same() -> None:
    model = tank("offset", "level bias")
    datum = Parameter(name="datum", unit="m", typical=0.01, prior_sd=0.02)

    def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
        return {"level": model.simulate(window, values, extra)["level"] + values["datum"]}

    beside = replace(model, nuisances=(*model.nuisances, datum), simulate=simulate)
    (found,) = examine(beside, [record(4, bias=0.5)], SETTINGS).findings
    assert {*found.members} == {"offset", "level bias"}
    assert found.group[0].likelihood_difference == pytest.approx(0.0, abs=0.1)


def test_effects_of_which_both_are_there_are_no_group() -> None:
    result = examine(tank("leak", "level delay"), [record(3, leak=0.05, delay_s=0.35)], SETTINGS)
    assert sorted(result.named) == ["leak", "level delay"]
    assert [f.group for f in result.findings] == [[], []]


def test_a_lag_and_a_delay_that_cancel_are_no_names() -> None:
    problem = Problem(tank("level delay", "level lag"), [record(3)])
    apart = problem.start().with_shared({"level.delay": -0.28, "level.lag": 0.28})
    state = assess(problem, ("level delay", "level lag"), problem.start(), SETTINGS)
    state = replace(state, fit=replace(state.fit, values=apart))
    for test in drop_one_tests(problem, state, {}, OpenEnded(), SETTINGS):
        effect = problem.model.effect(test.effect)
        caveats = caveats_of(problem, state, test, effect, state.fit, OpenEnded(), SETTINGS)
        assert any("cancel" in caveat for caveat in caveats)
