"""When a finding is the best proxy and not the cause."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.caveats import caveats_of, prior_conflicts
from discrepancy.decision.drop_one import drop_one_tests
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.model.description import Model, Window
from discrepancy.selection.open_ended import OpenEnded, explore
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Array, Recording, signal
from tests.discrepancy.toys import record, simulate, tank

STRICT = Settings()


def test_an_effect_that_closes_too_little_of_the_gap_is_the_best_proxy() -> None:
    """A leak of 0.05 beside a quadratic one: the leak alone closes 97 % of what the open-ended equation shows to be possible."""
    recording = record(5, leak=0.05, square=0.02, noise=0.005)
    problem = Problem(tank("leak", "level scale"), [recording])
    state, _ = search(problem, STRICT)
    equation = explore(problem, state, STRICT)
    (test,) = drop_one_tests(problem, state, {}, equation, STRICT)
    assert 0.9 < test.gap_closed < 0.99
    leak = problem.model.effect("leak")
    loose, strict = (
        caveats_of(problem, state, test, leak, state.fit, equation, replace(STRICT, gap_closed=limit))
        for limit in (0.5, 0.99)
    )
    assert loose == []
    (caveat,) = strict
    assert "of the gap" in caveat


def test_evidence_that_is_not_there_on_held_out_data_is_a_caveat() -> None:
    """The search asks it of every effect by itself; it is asked again beside the others."""
    problem = Problem(tank("leak"), [record(3, leak=0.05)])
    state, _ = search(problem, STRICT)
    [test] = drop_one_tests(problem, state, {}, OpenEnded(), STRICT)
    [leak] = problem.model.effects
    weak = replace(test, held_out_sse_reduction=0.1 * test.data_sse_reduction)
    sure, doubted = (
        caveats_of(problem, state, given, leak, state.fit, OpenEnded(), STRICT) for given in (test, weak)
    )
    assert sure == []
    assert len(doubted) == 1
    assert "held-out" in doubted[0]


def moved_area(share: Array) -> tuple[float, list[str]]:
    """Of readings of this share of the level: how far the tank's area is from its prior, in standard deviations, and the caveats on it."""
    recording = record(3)
    level = recording.signals["level"]
    read = replace(
        recording, signals={**recording.signals, "level": replace(level, value=share * level.value)}
    )
    problem = Problem(replace(tank(), effects=()), [read])
    state, _ = search(problem, STRICT)
    area = problem.model.nuisances[0]
    assert area.prior_sd is not None
    away = (state.fit.values.shared["area"] - area.value) / area.prior_sd
    return away, prior_conflicts(problem, state.fit, state.noise)


def test_a_nuisance_conflicts_with_its_prior_where_its_interval_does() -> None:
    """Readings of 85 % are another area. Readings of 75 % in every other quarter move it as well, but blocks of time disagree on where."""
    rows = record(3).signals["level"].value.size
    away, (caveat,) = moved_area(np.full(rows, 0.85))
    assert away > 3.0
    assert "the nuisance area" in caveat
    away, caveats = moved_area(np.where(4 * np.arange(rows) // rows % 2 == 0, 0.75, 1.0))
    assert away > 3.0
    assert caveats == []


SIDES = ("left", "right")


def two_tanks(share: float) -> Model:
    """Two tanks, and one effect with a leak of each. share: of the left one's inflow that the right one gets."""
    alone = tank("leak")
    [leak] = alone.effects[0].parameters
    level = alone.nuisances[1]

    def both(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
        found = {}
        for side, part in zip(SIDES, (1.0, share), strict=True):
            own = {
                "area": 1.0 / part,
                "level": values[f"{side}.level"],
                "leak": values.get(f"{side}.leak", 0.0),
            }
            found |= {side: simulate(window, own, {})["level"]}
        return found

    return replace(
        alone,
        outputs=dict.fromkeys(SIDES, "m"),
        nuisances=tuple(
            replace(level, name=f"{side}.level", guess=lambda w, side=side: w.at_start(side))
            for side in SIDES
        ),
        effects=(
            replace(alone.effects[0], parameters=tuple(replace(leak, name=f"{side}.leak") for side in SIDES)),
        ),
        simulate=both,
        ports=(),
    )


@pytest.mark.parametrize(("share", "named"), [(1.0, ["leak"]), (0.01, [])])
def test_a_part_that_is_absent_for_certain_does_not_cost_the_name(share: float, named: list[str]) -> None:
    """Only the left tank leaks. That the right one does not shows where it is filled as well; else nobody knows."""
    left, right = record(3, leak=0.05), record(3)
    tight = right.signals["level"].value
    noise = 0.02 * np.random.default_rng(8).normal(size=tight.size)
    seen = Recording(
        "tanks",
        {
            "inflow": left.signals["inflow"],
            "left": left.signals["level"],
            "right": signal(right.signals["level"].time_s, share * tight + noise, "m"),
        },
    )
    result = examine(two_tanks(share), [seen], STRICT)
    assert result.named == named
    [leak] = result.findings
    assert leak.parameters[0].value == pytest.approx(0.05, abs=0.005)
    if not named:
        assert any("right.leak" in caveat for caveat in leak.caveats)


def test_a_sensors_fault_that_helps_every_reading_but_its_own_is_a_proxy() -> None:
    """What is wrong with a reading that drives the model is in the others too; a fault has to show in the reading itself."""
    problem = Problem(tank("level delay"), [record(3, delay_s=0.35)])
    state, _ = search(problem, STRICT)
    (test,) = drop_one_tests(problem, state, {}, OpenEnded(), STRICT)
    assert (test.effect, test.error_ratio["level"] < 0.9) == ("level delay", True)
    delay = problem.model.effect("level delay")
    elsewhere = replace(test, error_ratio={"level": 1.01, "flow": 0.5})
    said = [caveats_of(problem, state, t, delay, state.fit, OpenEnded(), STRICT) for t in (test, elsewhere)]
    assert said == [[], ["does not improve the prediction of level, the reading that it is to change"]]
