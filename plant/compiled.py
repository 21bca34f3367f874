"""The compiler of the plant: numba, with a cache that notices changed sources.

numba stores machine code beside each module and recompiles when that module changes, but not when
a function it calls in another module does. Here any changed source empties the cache.
"""

import hashlib
from pathlib import Path

from numba import njit

from plant.effects.library import effect_files

FOLDER = Path(__file__).resolve().parent
SOURCES = (
    "compiled.py",
    "parameters.py",
    "state.py",
    "tyre.py",
    "multibody.py",
    "kinematics.py",
    "workspace.py",
    "dynamics.py",
    "truth.py",
    "resting.py",
    "follow.py",
    "effects/ports.py",
)


def sources_digest(folder: Path = FOLDER) -> str:
    """A digest of every source that machine code is made from, the effects included."""
    paths = [*(folder / name for name in SOURCES), *effect_files()]
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


def _forget_stale_code(folder: Path) -> None:
    """Delete the cached machine code if it was not made from the sources as they are now."""
    digest = sources_digest(folder)
    stamp = folder / "__pycache__" / "compiled.stamp"
    try:
        if stamp.is_file() and stamp.read_text(encoding="ascii") == digest:
            return
        for place in {folder, folder / "effects", *(path.parent for path in effect_files())}:
            for cached in (place / "__pycache__").glob("*.nb[ic]"):
                cached.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(digest, encoding="ascii")
    except OSError:
        return  # a folder that cannot be written to cannot go stale either


_forget_stale_code(FOLDER)

compiled = njit(cache=True, error_model="numpy")

released = njit(cache=True, error_model="numpy", nogil=True)
"""For long work that may run beside other threads: it lets go of the interpreter while it runs."""
