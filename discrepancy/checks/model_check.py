"""Simulates a user's model once before all else, so that an error in the model is reported as such and not as a bad recording."""

import traceback
from collections.abc import Mapping

import numpy as np

from bus.user_error import UserError
from discrepancy.estimation.problem import Problem


class BadModel(UserError, ValueError):
    """A model whose function raises, or returns something else than the model describes."""


def check_model(problem: Problem) -> None:
    """Simulate the first window of a problem at the baseline. Raises BadModel."""
    model, window = problem.model, problem.windows[0]
    start = problem.start()
    with np.errstate(all="ignore"):
        try:
            returned = model.simulate(window, start.in_window(0), {})
        except Exception as error:
            raise BadModel(
                f"model {model.name}: its simulate fails{_place(model.simulate, error)}"
            ) from error
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


def _place(simulate: object, error: Exception) -> str:
    """', in tank.py, line 12: KeyError 'areaa'': the deepest line in the function's own file, since that is the one to mend."""
    frames = traceback.extract_tb(error.__traceback__)
    file = getattr(getattr(simulate, "__code__", None), "co_filename", None)
    at = next((f for f in reversed(frames) if f.filename == file), frames[-1])
    what = error.args[0] if isinstance(error, KeyError) and error.args else error
    return f", {at.filename}, line {at.lineno}: {type(error).__name__}: {what}"
