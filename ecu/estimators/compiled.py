"""One source, three uses: the estimators are plain Python, compiled for the live loop and for columns.

Only scalars, named tuples of floats, `if`, `for ... in range` and calls of one another are used, so
that the same text can be run by Python, compiled by numba and exported to C.
"""

from pathlib import Path

from bus.cache_folder import digest_of
from bus.machine_code import code_folder, compiler

_FOLDER = Path(__file__).resolve().parent

_CODE = code_folder(_FOLDER, "estimators", digest_of(sorted(_FOLDER.rglob("*.py"))))

compiled = compiler(_CODE, fastmath=False)
"""Compiles at the first call, without reordering floating point: same results as Python."""

inlined = compiler(_CODE, fastmath=False, forceinline=True)
"""As `compiled`, and copied into its callers: for what every step of a prediction calls, where handing over its records of
numbers takes a tenth of the step."""

released = compiler(_CODE, fastmath=False, nogil=True)
"""For long work beside other threads: it lets go of the interpreter while it runs."""
