"""Keeps numba's machine code, for plant and ECU, in a folder that a changed source cannot leave stale.

numba recompiles a cached function when the function's own file changes, but not when a function it calls
in another file does, wherever the code is kept. A folder per state of all sources together cannot be stale.

The code is for a model of processor that nearly all computers have, not for this one's own, and is found by names that do not
hold the place of the installation. So it can be installed with the package (`make wheel`, ADR 73).
"""

import inspect
import platform
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, get_args, get_origin

import llvmlite.binding as llvm
import numba
from numba.core import caching
from numba.core.options import DefaultOptions
from numba.extending import register_jitable

from bus.cache_folder import ROOT, cache_folder

P = ParamSpec("P")
R = TypeVar("R")

_CONFIG: Any = numba.config  # its settings are made at run time
IN_PYTHON = bool(_CONFIG.DISABLE_JIT)
"""Whether there is no machine code, for a debugger (NUMBA_DISABLE_JIT=1): what only machine code can do needs another way."""

# numba counts references to every array that a function is given or takes a part of. A step of the plant hands around two
# dozen arrays through some forty calls, and more than half of its time was counting. The option that leaves the counting out
# is numba's own and not documented (ADR 48). It is inherited by what a function calls, so both values are always said.
_HAS_OPTION = hasattr(DefaultOptions, "_nrt")
COUNTED: dict[str, Any] = {"_nrt": True} if _HAS_OPTION else {}
"""Options of a compiler whose functions may allocate arrays and return them."""
UNCOUNTED: dict[str, Any] = {"_nrt": False} if _HAS_OPTION else {}
"""Options of a compiler whose functions must not; without the option they are compiled as the others are, only slower."""


PROCESSOR = "x86-64-v3"
"""The processor that code is made for: Intel's since 2013, AMD's since 2015. Wider vectors gained the plant nothing (ADR 73)."""
NEEDED = frozenset(
    [
        "avx",
        "avx2",
        "bmi",
        "bmi2",
        "cx16",
        "f16c",
        "fma",
        "lzcnt",
        "movbe",
        "popcnt",
        "sahf",
        "sse3",
        "sse4.1",
        "sse4.2",
        "ssse3",
        "xsave",
    ]
)
"""What makes a processor of this model, by LLVM's names (System V ABI, AMD64 supplement, table 3.1)."""


def has_processor(machine: str, features: Mapping[str, bool]) -> bool:
    """Whether a computer runs code for `PROCESSOR`. features: by LLVM's names."""
    return machine == "x86_64" and all(features.get(name, False) for name in NEEDED)


def _choose_processor() -> None:
    """Have numba make code for `PROCESSOR`, unless the user chose one or this computer lacks something of it."""
    chosen = _CONFIG.CPU_NAME is not None or _CONFIG.CPU_FEATURES is not None
    if not chosen and has_processor(platform.machine(), llvm.get_host_cpu_features()):
        _CONFIG.CPU_NAME, _CONFIG.CPU_FEATURES = PROCESSOR, ""


_choose_processor()  # before numba makes or loads the first code of this process

_ByFolder: Any = getattr(caching, "UserProvidedCacheLocator", object)


class Locator(_ByFolder):  # type: ignore[misc]  # numba has no types
    """Where numba keeps the code of a function within its folder: by the name of the package, not by where that is installed."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """The folder of a source's functions."""
        place = _place(py_file, _CONFIG.CACHE_DIR)
        if place is None:
            place = super().get_suitable_cache_subpath(py_file)
        return place

    def ensure_cache_path(self) -> None:
        """Make the folder of a source's functions."""
        # numba makes and removes a file in it for each function; code_folder has seen that it can be written to
        _make(self.get_cache_path())


@cache  # as below: a source has dozens of functions, and each of them asks
def _place(py_file: str, kept: str) -> str | None:
    """Where within the folder `kept` the code of a source's functions lies; None for a source that is not ours."""
    source = Path(py_file).resolve()
    if source.is_relative_to(Path(kept).resolve()):
        return "generated"  # what the plant writes beside its code
    return ".".join(source.parent.relative_to(ROOT).parts) if source.is_relative_to(ROOT) else None


@cache
def _make(folder: str) -> None:
    Path(folder).mkdir(parents=True, exist_ok=True)


def code_folder(package: Path, name: str, digest: str) -> Path:
    """The folder for the machine code of a package as its sources are now; in NUMBA_CACHE_DIR if that is set.

    Errors: NoCacheFolderError.
    """
    return cache_folder(package, name, digest, _CONFIG.CACHE_DIR)


@contextmanager
def _kept_in(folder: Path) -> Iterator[None]:
    """Functions that are given to numba meanwhile keep their machine code in `folder`."""
    # numba reads both when a function is decorated, so they are set only around that
    before = _CONFIG.CACHE_DIR, getattr(_CONFIG, "CACHE_LOCATOR_CLASSES", "")
    _CONFIG.CACHE_DIR = str(folder)
    if _ByFolder is not object:  # an older numba has other locators: code is found where it was made only
        _CONFIG.CACHE_LOCATOR_CLASSES = f"{__name__}.{Locator.__name__}"
    try:
        yield
    finally:
        _CONFIG.CACHE_DIR, _CONFIG.CACHE_LOCATOR_CLASSES = before


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


def translatable(**options: Any) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A decorator for what stays Python where Python calls it, and is compiled into the compiled functions that call it.

    So a rule that is short and called once in a while has one text, is tried with any numbers at no cost of compiling, and takes
    no call of its own within compiled code.
    """

    def marked(function: Callable[P, R]) -> Callable[P, R]:
        made: Callable[P, R] = register_jitable(**options)(function)
        return made

    return marked


def direct(function: Callable[P, R], *arguments: Any) -> Callable[P, R]:
    """The machine code of a compiled function for arguments of these types, for calls whose arguments never have others.

    numba looks at every array that it is given before it calls the code; at a hundred calls per second with some forty arrays
    that takes longer than a step of the plant.
    Without machine code it is the function itself.
    """
    if IN_PYTHON:
        return function
    dispatcher: Any = function
    made: Callable[P, R] = dispatcher.compile(tuple(map(numba.typeof, arguments)))
    return made


def _is_plain(annotation: Any) -> bool:
    """Whether a result of this type holds no array."""
    if get_origin(annotation) is tuple:
        return all(map(_is_plain, get_args(annotation)))
    return annotation in (None, float, int, bool)
