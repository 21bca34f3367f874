"""A model whose own code fails: an error of the model, whatever the recordings are."""

import traceback
from typing import Self

from bus.user_error import UserError
from discrepancy.model.description import Model, Parameter


class BadModel(UserError, ValueError):
    """A model whose function raises, or returns something else than the model describes."""

    @classmethod
    def failing(cls, model: Model, error: Exception, guess_of: Parameter | None = None) -> Self:
        """Its simulate raised this, or the guess of an initial state."""
        # what is raised for the user says by itself where the fault is; a line of the code that raised it would mislead
        if isinstance(error, UserError):
            return cls(f"model {model.name}: {error}")
        if guess_of is None:
            return cls(f"model {model.name}: its simulate fails{_place(model.simulate, error)}")
        return cls(f"model {model.name}: the guess of {guess_of.name} fails{_place(guess_of.guess, error)}")


def _place(function: object, error: Exception) -> str:
    """', in tank.py, line 12: KeyError 'areaa'': the deepest line in the function's own file, since that is the one to mend."""
    frames = traceback.extract_tb(error.__traceback__)
    file = getattr(getattr(function, "__code__", None), "co_filename", None)
    at = next((f for f in reversed(frames) if f.filename == file), frames[-1])
    what = error.args[0] if isinstance(error, KeyError) and error.args else error
    return f", {at.filename}, line {at.lineno}: {type(error).__name__}: {what}"
