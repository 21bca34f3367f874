"""The compiler of codecs and readers: numba, its code kept by the state of all sources of this package."""

from functools import partial
from pathlib import Path

from bus.cache_folder import digest_of
from bus.machine_code import UNCOUNTED, code_folder, compiler

_FOLDER = Path(__file__).resolve().parent
_made = partial(compiler, code_folder(_FOLDER, "dbc", digest_of(sorted(_FOLDER.rglob("*.py")))))

packing = _made(error_model="numpy", **UNCOUNTED)
"""For the packing of frames, which runs in every tick and allocates nothing."""

released = _made(nogil=True)
"""For work on many frames, beside other threads."""

quotients = _made(nogil=True, error_model="numpy")
"""As `released`; a division by zero gives infinity or not-a-number."""

inlined = _made(nogil=True, forceinline=True)
"""As `released`, and copied into its callers by the compiler."""

merged = _made(nogil=True, inline="always")
"""As `released`, and copied into its callers' source, which may pass results of several types."""
