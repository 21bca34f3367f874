"""Simulates a user's model once before all else, so that an error in the model is reported as such and not as a bad recording."""

from collections.abc import Mapping

import numpy as np

from discrepancy.estimation.problem import Problem
from discrepancy.model.failure import BadModel


def check_model(problem: Problem) -> None:
    """Simulate the first window of a problem at the baseline. Raises BadModel."""
    model, window = problem.model, problem.windows[0]
    start = problem.start()
    with np.errstate(all="ignore"):
        try:
            returned = model.simulate(window, start.in_window(0), {})
        except Exception as error:
            raise BadModel.failing(model, error) from error
    if not isinstance(returned, Mapping):
        raise BadModel(
            f"model {model.name}: simulate must return a mapping of outputs, not {type(returned).__name__}"
        )
    if gone := [name for name in problem.channels if name not in returned]:
        raise BadModel(
            f"model {model.name}: simulate returns {', '.join(returned) or 'nothing'}, but no {', '.join(gone)}"
        )
    for name, values in returned.items():
        shape, wanted = np.shape(values), window.time_s.shape
        if shape != wanted:
            raise BadModel(
                f"model {model.name}: simulate returns {name} of shape {shape}; it must be {wanted}, a value for each of window.time_s"
            )
