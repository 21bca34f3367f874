"""A model that diverges at values which a search tries: they lose, and nothing breaks."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.estimation.problem import Problem
from discrepancy.examine import investigate
from discrepancy.model import Effect, Model, Parameter
from discrepancy.model.failure import BadModel
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Recording, Signal

STAMPS = np.arange(0.0, 40.0, 0.1)


def simulate(window, values, extra):
    """dx/dt = u - x + k x^3: diverges in finite time where k x^2 > 1. Python's floats raise OverflowError there."""
    pushed = window["push"] + extra.get("push", 0.0)
    place, places = values["start"], []
    for u in pushed.tolist():
        places.append(place)
        place += window.step_s * (u - place + values.get("cubic", 0.0) * place**3)
    return {"place": np.array(places)}


def model(simulate=simulate, window_s=20.0):
    return Model(
        name="unstable", sentence="a place that is pushed", inputs={"push": "N"}, outputs={"place": "m"},
        nuisances=(Parameter(name="start", unit="m", typical=0.1, scope="window", guess=lambda w: w.at_start("place")),),
        effects=(
            Effect(
                name="softening", sentence="it softens", equation="+ k x^3", kind="physics", place="spring", excited_by="far",
                parameters=(Parameter(name="cubic", unit="1/m^2", lower=-50.0, upper=50.0, typical=0.2),),
            ),
        ),
        simulate=simulate, step_s=0.1, window_s=window_s,
    )  # fmt: skip


def recording(cubic, seed=0):
    rng = np.random.default_rng(seed)
    push = 0.8 * np.sin(0.7 * STAMPS)
    window = type("W", (), {"__getitem__": lambda self, name: push, "step_s": 0.1})()
    place = simulate(window, {"start": 0.0, "cubic": cubic}, {})["place"]
    return Recording(
        "run",
        {
            "push": Signal(STAMPS, push, "N"),
            "place": Signal(STAMPS, place + rng.normal(0, 0.005, place.size), "m"),
        },
    )


def test_a_diverged_prediction_is_finite_and_worse_than_any_other():
    problem = Problem(model(), [recording(0.0)])
    start = problem.start()
    far = start.having(cubic=50.0)
    sound = problem.predict(start)
    assert not problem.diverged(sound).any()
    for rows in (problem.predict(far), *problem.predict_each([far])):
        assert np.isfinite(rows).all()
        assert problem.diverged(rows).any()
        assert np.sum((rows - problem.measured) ** 2) > 1e6 * np.sum((sound - problem.measured) ** 2)


def test_a_prediction_that_does_not_diverge_is_that_of_the_model():
    problem = Problem(model(), [recording(0.0)])
    start = problem.start()
    window = problem.windows[0]
    expected = simulate(window, start.in_window(0), {})["place"]
    block = problem.blocks[0]
    rows = problem.predict(start)[block.start : block.stop]
    np.testing.assert_array_equal(rows, np.interp(block.time_s, window.time_s, expected))


def test_an_error_in_the_models_code_is_no_divergence():
    def faulty(window, values, extra):
        if values.get("cubic", 0.0):
            raise ZeroDivisionError("division by zero")
        return simulate(window, values, extra)

    problem = Problem(model(faulty), [recording(0.0)])
    with pytest.raises(
        BadModel, match=r"its simulate fails, .*test_divergence\.py, line .*ZeroDivisionError"
    ):
        problem.predict(problem.start().having(cubic=0.1))


def test_an_error_in_a_guess_names_its_place():
    def guess(window):
        return window["slope"][0]

    plain = model()
    faulty = replace(plain, nuisances=tuple(replace(p, guess=guess) for p in plain.nuisances))
    with pytest.raises(
        BadModel, match=r"the guess of \w+ fails, .*test_divergence\.py, line .*no signal 'slope'"
    ):
        Problem(faulty, [recording(0.0)]).start()


@pytest.mark.parametrize("window_s", [5.0, 10.0, 20.0])
@pytest.mark.parametrize(("cubic", "status"), [(0.0, "nothing missing"), (0.3, "explained")])
def test_the_diagnosis_survives_it_and_is_right(cubic, status, window_s):
    """In windows of any length: with initial states free to run away, short ones hid the effect."""
    recordings = [recording(cubic, seed) for seed in range(2)]
    found = investigate(model(window_s=window_s), recordings, Settings()).findings
    assert found.status == status, found.reasons
    if cubic:
        estimate = found.findings[0].parameters[0]
        assert estimate.low < cubic < estimate.high
