"""One source, three uses: the estimators are plain Python, compiled for the live loop and for columns.

Only scalars, named tuples of floats, `if`, `for ... in range` and calls of one another are used, so
that the same text can be run by Python, compiled by numba and exported to C.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba

P = ParamSpec("P")
R = TypeVar("R")


def _digest() -> str:
    """Fingerprint of every source file of this package."""
    fingerprint = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        fingerprint.update(source.read_bytes())
    return fingerprint.hexdigest()[:16]


# numba judges a cached function by its own file only and would keep stale code of the functions it
# calls; a folder per state of the whole package cannot.
_CACHE = Path(__file__).parent / "__pycache__" / f"estimators-{_digest()}"


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile at the first call, without reordering floating point; same results as Python."""
    config: Any = numba.config  # its settings are made at run time
    folder = config.CACHE_DIR
    config.CACHE_DIR = str(_CACHE)
    try:
        result: Callable[P, R] = numba.njit(cache=True, fastmath=False)(function)
    finally:
        config.CACHE_DIR = folder
    return result
