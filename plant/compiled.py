"""The compiler of the plant: numba, with a cache that notices changed sources.

numba stores machine code beside each module and recompiles when that module changes, but not when
a function it calls in another module does. Here any changed source empties the cache.
"""

import hashlib
from pathlib import Path

from numba import njit

SOURCES = (
    "compiled.py",
    "parameters.py",
    "state.py",
    "tyre.py",
    "multibody.py",
    "kinematics.py",
    "dynamics.py",
)


def _forget_stale_code(folder: Path) -> None:
    """Delete the cached machine code if it was not made from the sources as they are now."""
    digest = hashlib.sha256(b"".join((folder / name).read_bytes() for name in SOURCES)).hexdigest()
    stamp = folder / "__pycache__" / "compiled.stamp"
    try:
        if stamp.is_file() and stamp.read_text(encoding="ascii") == digest:
            return
        for cached in (folder / "__pycache__").glob("*.nb[ic]"):
            cached.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(digest, encoding="ascii")
    except OSError:
        return  # a folder that cannot be written to cannot go stale either


_forget_stale_code(Path(__file__).resolve().parent)

compiled = njit(cache=True, error_model="numpy")
