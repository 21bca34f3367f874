"""A found equation as a part of the model."""

from discrepancy.estimation.fit import fit
from discrepancy.estimation.noise import white_noise
from discrepancy.estimation.problem import Problem
from discrepancy.selection.open_ended import explore, extended
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings
from tests.discrepancy.toys import record, tank

STRICT = Settings()


def test_a_found_equation_built_into_the_model_explains_the_recording() -> None:
    model, recording = tank("level scale"), record(5, square=0.02, noise=0.005)
    problem = Problem(model, [recording])
    state, _ = search(problem, STRICT)
    found = explore(problem, state, STRICT)
    grown = Problem(extended(model, found), [recording])
    noise = white_noise(problem, problem.measured)
    before = fit(problem, noise, ("area",), problem.start())
    after = fit(grown, noise, ("area",), grown.start())
    assert after.sse < 0.6 * before.sse
