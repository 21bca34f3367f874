"""Steps, windows and intervals of a fit."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from discrepancy.estimation.effort import Effort
from discrepancy.estimation.fit import WindowStates, differences, fit
from discrepancy.estimation.noise import estimate_noise, white_noise
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Model, Parameter, Window
from discrepancy.selection.assess import assess
from discrepancy.selection.candidate_fits import held_out_residual
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings, free_names
from discrepancy.signals.recording import Array, Recording, signal
from tests.discrepancy.toys import record, tank

STRICT = Settings()
# A power of two: with a rounded step a window of 5 s would begin with the last reading of the coast before.
STEP_S = 0.0625


def stopping() -> Model:
    """Coasts down at a constant rate and stands: v = max(0, v0 - drag t)."""

    def simulate(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
        t = window.time_s - window.time_s[0]
        return {"speed": np.maximum(values["start"] - values["drag"] * t, 0.0)}

    drag = Parameter(name="drag", unit="m/s^2", value=0.5, lower=0.0, upper=5.0, typical=0.1)
    start = Parameter(
        name="start", unit="m/s", typical=0.1, scope="window", guess=lambda w: w.at_start("speed")
    )
    return Model(
        name="stopping",
        sentence="",
        inputs={},
        outputs={"speed": "m/s"},
        nuisances=(drag, start),
        effects=(),
        simulate=simulate,
        step_s=STEP_S,
        window_s=5.0,
    )


def coasting(seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 5.0, STEP_S)
    coasts = [np.maximum(v - t, 0.0) for v in rng.uniform(0.3, 6.0, 12)]
    # The reading at the end makes each of the windows one coast.
    speed = np.concatenate([*coasts, [0.0]])
    noise = lfilter([1.0], [1.0, -0.95], rng.normal(0.0, 0.02, speed.size))
    return Recording("coast", {"speed": signal(STEP_S * np.arange(speed.size), speed + noise, "m/s")})


@pytest.mark.parametrize(("typical", "at"), [(0.05, 1.0), (-0.05, 0.0), (0.05, 0.0), (-0.05, 1.0)])
def test_no_slope_is_taken_outside_the_bounds(typical: float, at: float) -> None:
    """Whichever way a typical change goes, and at either end."""
    model, tried = tank("leak"), []

    def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
        tried.append(values["leak"])
        return model.simulate(window, values, extra)

    (leak,) = model.effects
    leak = replace(leak, parameters=(replace(leak.parameters[0], typical=typical),))
    problem = Problem(replace(model, effects=(leak,), simulate=simulate), [record(6)])
    values = problem.start().with_shared({"leak": at})
    base = problem.predict(values)
    tried.clear()
    (slope,) = differences(problem, values, base, ["leak"]).T
    assert tried
    assert all(0.0 <= leak <= 1.0 and leak != at for leak in tried)
    inside = 1e-4 if at == 0.0 else -1e-4
    secant = (problem.predict(values.with_shared({"leak": at + inside})) - base) / inside
    np.testing.assert_allclose(slope, secant, atol=1e-3 * np.abs(secant).max())


def test_one_window_that_bends_does_not_hold_back_the_others() -> None:
    """Windows end in a stop that depends on their own start, under coloured noise: from afar the fit comes near the truth all the same."""
    ends = []
    for seed in (5, 8, 12, 13, 27):
        problem = Problem(stopping(), [coasting(seed)])
        flat = white_noise(problem, problem.measured - problem.predict(problem.start()))
        near = fit(problem, flat, ("drag",), problem.start().having(drag=1.0), effort=Effort(iterations=20))
        noise = estimate_noise(problem, problem.measured - problem.predict(near.values), 13.0)
        far = fit(problem, noise, ("drag",), problem.start().having(drag=0.3), effort=Effort(iterations=20))
        ends.append(far.values.shared["drag"])
    assert np.median(np.abs(np.array(ends) - 1.0)) < 0.1


def test_more_parameters_lower_the_fitted_error_and_raise_the_held_out_one() -> None:
    """Nothing is left out: what five effects fit is noise, and noise does not come back."""
    gained, held = 0.0, 0.0
    for seed in range(6):
        problem = Problem(tank(), [record(40 + seed, duration_s=80.0)])
        state, _ = search(problem, STRICT)
        names = ("leak", "offset", "level scale", "level delay", "level lag")
        full = fit(problem, state.noise, free_names(problem, names), state.fit.values)
        gained += state.fit.sse - full.sse
        few = held_out_residual(problem, state.noise, (), state.fit.values, STRICT)
        many = held_out_residual(problem, state.noise, names, state.fit.values, STRICT)
        held += float(np.sum(few**2) - np.sum(many**2))
    assert gained > 0.0
    assert held < 0.0


def test_projection_leaves_nothing_of_the_initial_states() -> None:
    rng = np.random.default_rng(0)
    window = np.repeat([0, 1, 2], 40)
    local, rows = rng.normal(size=(120, 2)), np.ones(120, bool)
    states = WindowStates(local, window, rows)
    left = states.off(rng.normal(size=120))
    for w in range(3):
        assert np.abs(local[window == w].T @ left[window == w]).max() < 1e-9
    change = states.solve(local @ np.array([1.5, -0.5]), 3, window)
    np.testing.assert_allclose(change, [[1.5, -0.5]] * 3, atol=1e-9)


def test_projection_does_not_depend_on_units_of_initial_states() -> None:
    rng = np.random.default_rng(1)
    window = np.repeat([0, 1, 2], 40)
    local, rows, seen = rng.normal(size=(120, 3)), np.ones(120, bool), rng.normal(size=120)
    local[window == 1, 2] = 0.0  # a state that does nothing in one window
    units = np.array([1.0, 1e-11, 1e9])
    plain, other = WindowStates(local, window, rows), WindowStates(local * units, window, rows)
    assert plain.used == other.used == 8
    np.testing.assert_allclose(other.off(seen), plain.off(seen), atol=1e-12)
    np.testing.assert_allclose(
        other.solve(seen, 3, window) * units, plain.solve(seen, 3, window), rtol=1e-9, atol=1e-12
    )


def sledge() -> Model:
    """A mass of 1 kg that a force pushes over a dry floor: dv/dt = F - c sign(v), seen by its place."""

    def simulate(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
        place, speed, h, places = values["start"], values["start_speed"], window.step_s, []
        for force in window["force"]:
            places.append(place)
            before, free = speed, speed + h * force
            # friction takes away speed, and never turns it
            speed = np.sign(free) * max(abs(free) - h * values.get("dry", 0.0), 0.0)
            place += 0.5 * h * (before + speed)
        return {"place": np.array(places)}

    return Model(
        name="sledge",
        sentence="",
        inputs={"force": "N"},
        held=("force",),
        outputs={"place": "m"},
        nuisances=(
            Parameter(
                name="start", unit="m", typical=0.01, scope="window", guess=lambda w: w.at_start("place")
            ),
            Parameter(name="start_speed", unit="m/s", typical=0.05, scope="window"),
        ),
        effects=(
            Effect(
                name="dry friction",
                sentence="",
                equation="",
                parameters=(Parameter(name="dry", unit="N", lower=0.0, upper=20.0, typical=0.5),),
                kind="physics",
                place="",
            ),
        ),
        simulate=simulate,
        step_s=0.01,
        window_s=2.0,
    )


def pushed(seed: int) -> Recording:
    """Pushes of half a second to either side, each from rest, against 4 N: the place in closed form."""
    rng, since = np.random.default_rng(seed), 0.01 * np.arange(100)
    place, force = [], []
    begin, dry = 0.0, 4.0
    for number in range(12):
        push = (-1.0) ** number * rng.uniform(6.0, 10.0)
        fast = abs(push) - dry
        slowing = np.clip(since - 0.5, 0.0, 0.5 * fast / dry)
        gone = np.where(
            since < 0.5, 0.5 * fast * since**2, 0.125 * fast + 0.5 * fast * slowing - 0.5 * dry * slowing**2
        )
        place.append(begin + np.sign(push) * gone)
        force.append(np.where(since < 0.5, push, 0.0))
        begin = float(place[-1][-1])
    time_s = 0.01 * np.arange(1200)
    seen = np.concatenate(place) + rng.normal(0.0, 1e-3, 1200)
    return Recording(
        "pushes",
        {
            "force": signal(time_s, np.concatenate(force), "N", held=True),
            "place": signal(time_s, seen, "m"),
        },
    )


@pytest.mark.parametrize("seed", range(3))
def test_initial_states_that_stood_in_for_a_missing_force_let_go(seed: int) -> None:
    """Without friction, windows begin with speeds that make up for it. With friction each of them is a minimum of its own."""
    problem = Problem(sledge(), [pushed(seed)])
    noise = white_noise(problem, np.resize([1e-3, -1e-3], problem.measured.size))
    imitated = fit(problem, noise, (), problem.start()).values
    assert np.max(np.abs(imitated.local["start_speed"])) > 1.0
    fresh = fit(problem, noise, ("dry",), problem.start().having(dry=4.2))
    found = fit(problem, noise, ("dry",), imitated.having(dry=4.2))
    # held there, friction ends at 3.4 to 3.6 N
    assert found.values.shared["dry"] == pytest.approx(4.0, abs=0.1)
    assert found.sse < 1.05 * fresh.sse


@pytest.mark.parametrize("seed", range(3))
def test_an_accepted_effect_begins_without_what_imitated_it(seed: int) -> None:
    """The same where friction is found too small at first, so that no window alone is better with its guess."""
    problem = Problem(sledge(), [pushed(seed)])
    imitated = fit(problem, assess(problem, (), problem.start(), STRICT).noise, (), problem.start()).values
    found = assess(problem, ("dry friction",), imitated.having(dry=3.0), STRICT).fit.values
    assert found.shared["dry"] == pytest.approx(4.0, abs=0.05)
