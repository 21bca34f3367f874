"""Keeps numba's machine code, for plant and ECU, in a folder that a changed source cannot leave stale.

numba recompiles a cached function when the function's own file changes, but not when a function it calls
in another file does, wherever the code is kept. A folder per state of all sources together cannot be stale.
"""

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, get_args, get_origin

import numba
from numba.core.options import DefaultOptions

from bus.cache_folder import cache_folder

P = ParamSpec("P")
R = TypeVar("R")

# numba counts references to every array that a function is given or takes a part of. A step of the plant hands around two
# dozen arrays through some forty calls, and more than half of its time was counting. The option that leaves the counting out
# is numba's own and not documented (ADR 48). It is inherited by what a function calls, so both values are always said.
_HAS_OPTION = hasattr(DefaultOptions, "_nrt")
COUNTED: dict[str, Any] = {"_nrt": True} if _HAS_OPTION else {}
"""Options of a compiler whose functions may allocate arrays and return them."""
UNCOUNTED: dict[str, Any] = {"_nrt": False} if _HAS_OPTION else {}
"""Options of a compiler whose functions must not; without the option they are compiled as the others are, only slower."""


def code_folder(package: Path, name: str, digest: str) -> Path:
    """The folder for the machine code of a package as its sources are now; in NUMBA_CACHE_DIR if that is set.

    Errors: NoCacheFolderError.
    """
    config: Any = numba.config  # its settings are made at run time
    return cache_folder(package, name, digest, config.CACHE_DIR)


@contextmanager
def _kept_in(folder: Path) -> Iterator[None]:
    """Functions that are given to numba meanwhile keep their machine code in `folder`."""
    config: Any = numba.config
    # numba reads CACHE_DIR when a function is decorated, so it is set only around that
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        config.CACHE_DIR = before


def compiler(folder: Path, **options: Any) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A decorator like `numba.njit(**options)` whose machine code is kept in `folder`."""

    def compiled(function: Callable[P, R]) -> Callable[P, R]:
        with _kept_in(folder):
            made: Callable[P, R] = numba.njit(cache=True, **options)(function)
        return made

    return compiled


def uncounting(folder: Path, **options: Any) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A decorator as of `compiler` for functions that neither allocate arrays nor return them: they count no references.

    numba refuses one that allocates. One that returned an array would give away a reference that nobody counted, so the
    annotation of the result is checked: numbers, tuples of numbers or None.
    """
    make = compiler(folder, **options, **UNCOUNTED)

    def uncounted(function: Callable[P, R]) -> Callable[P, R]:
        given = inspect.get_annotations(function, eval_str=True).get("return", inspect.Parameter.empty)
        if not _is_plain(given):
            raise TypeError(
                f"{function.__module__}.{function.__qualname__} -> {given}: a function that counts no references "
                "returns None, numbers or tuples of numbers"
            )
        return make(function)

    return uncounted


def _is_plain(annotation: Any) -> bool:
    """Whether a result of this type holds no array."""
    if get_origin(annotation) is tuple:
        return all(map(_is_plain, get_args(annotation)))
    return annotation in (None, float, int, bool)
