"""Keeps numba's machine code, for plant and ECU, in a folder that a changed source cannot leave stale.

numba recompiles a cached function when the function's own file changes, but not when a function it calls
in another file does, wherever the code is kept. A folder per state of all sources together cannot be stale.
"""

import hashlib
import inspect
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, get_args, get_origin

import numba
from numba.core.options import DefaultOptions

from bus.user_error import UserError

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

KEPT_S = 86_400.0
"""How much older the code of other sources is when it is removed [s]: another process may still use it."""


class NoCacheFolderError(UserError, ValueError):
    """No place for machine code can be written to."""


def digest_of(sources: Iterable[Path]) -> str:
    """Fingerprint of the names and contents of files, 16 hexadecimal digits."""
    fingerprint = hashlib.sha256()
    for source in sources:
        content = source.read_bytes()
        # name and length separate the files: moving a line from one file to the next changes the digest
        fingerprint.update(f"{source}\0{len(content)}\0".encode())
        fingerprint.update(content)
    return fingerprint.hexdigest()[:16]


def code_folder(package: Path, name: str, digest: str) -> Path:
    """Make and return the folder for the machine code of a package as its sources are now.

    It is in NUMBA_CACHE_DIR if that is set, else in the package's own `__pycache__`, else, where that is
    not writable, in the user's cache. Errors: NoCacheFolderError where none of them is.
    """
    places = [package / "__pycache__", _of_user() / "loaderhil"]
    config: Any = numba.config  # its settings are made at run time
    if config.CACHE_DIR:
        places.insert(0, Path(config.CACHE_DIR))
    # an installed package may belong to another user; mkdir also succeeds on an existing folder without write access
    for place in places:
        folder = place / f"{name}-{digest}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            _forget_others(folder, name)
            return folder
    tried = ", ".join(map(str, places))
    raise NoCacheFolderError(
        f"no folder for compiled code can be written to (tried {tried}): free space or permissions?"
    )


def _of_user() -> Path:
    """Where this user's programs keep what they can make again."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _forget_others(folder: Path, name: str) -> None:
    """Remove the code of other states of the same package's sources that is KEPT_S older than this one."""
    made = folder.stat().st_mtime
    for other in folder.parent.glob(f"{name}-*"):
        # another checkout or an older process may still load it: only code that is a day older goes
        if other != folder and made - other.stat().st_mtime > KEPT_S:
            shutil.rmtree(other, ignore_errors=True)


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
