"""One source, three uses: the estimators are plain Python, compiled for the live loop and for columns.

Only scalars, named tuples of floats, `if`, `for ... in range` and calls of one another are used, so
that the same text can be run by Python, compiled by numba and exported to C.
"""

from collections.abc import Callable
from dis import get_instructions
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

from bus.cache_folder import digest_of
from bus.machine_code import UNCOUNTED, code_folder, compiler

P = ParamSpec("P")
R = TypeVar("R")

_FOLDER = Path(__file__).resolve().parent

_CODE = code_folder(_FOLDER, "estimators", digest_of(sorted(_FOLDER.rglob("*.py"))))

compiled = compiler(_CODE, fastmath=False)
"""Compiles at the first call, without reordering floating point: same results as Python."""

inlined = compiler(_CODE, fastmath=False, forceinline=True)
"""As `compiled`, and copied into its callers: for what every step of a prediction calls, where handing over its records of
numbers takes a tenth of the step."""

released = compiler(_CODE, fastmath=False, nogil=True)
"""For long work beside other threads: it lets go of the interpreter while it runs."""

_copied = compiler(_CODE, fastmath=False, error_model="numpy", forceinline=True)
_lanes = compiler(_CODE, fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)

_copies: dict[Any, Any] = {}


def side_by_side(function: Callable[P, R]) -> Callable[P, R]:
    """Compiled for a loop whose rows stand in the lanes of vectors: all that it calls is copied into it, and no division is checked.

    A division by zero gives infinity or NaN, where `compiled` raises ZeroDivisionError; the caller has to look for them.
    """
    return _lanes(_copy(function))


def _copy(function: Any) -> Any:
    """The function with copies of its own of all compiled functions that it calls."""
    found = {}
    for step in get_instructions(function):
        if step.opname != "LOAD_GLOBAL":
            continue
        name = step.argval
        value = function.__globals__.get(name)
        if hasattr(value, "py_func"):
            if value not in _copies:
                _copies[value] = _copied(_copy(value.py_func))
            found[name] = _copies[value]
    copy = FunctionType(
        function.__code__, function.__globals__ | found, function.__name__, function.__defaults__
    )
    # numba keeps code by this name, and another function has it already
    copy.__qualname__ = f"{function.__qualname__}_side_by_side"
    copy.__module__ = function.__module__
    return copy
