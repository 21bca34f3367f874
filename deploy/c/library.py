"""Builds the exported ECU as a shared library in double precision, for the bench, and keeps it as other compiled code is kept."""

import hashlib
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final

import dbc
from bus.cache_folder import NoCacheFolderError, digest_of
from bus.machine_code import code_folder
from bus.user_error import UserError
from ecu.calibration import Calibration

COMPILERS: Final = ("cc", "gcc", "clang")
OPTIONS: Final = (
    # -O3 and no errno, which nobody reads: 32.2 instead of 34.4 µs a cycle, the same frames. Small functions copied into their callers
    # beyond gcc's own limit: 39 instead of 48 µs (busy machine)
    "-std=c99", "-O3", "-finline-limit=1000", "-fno-math-errno", "-fPIC", "-DECU_DOUBLE", "-DECU_FINDINGS", "-DECU_SETTABLE",
    # a fused multiplication rounds once where Python rounds twice; on x86 there is none by default, on ARM there is
    "-ffp-contract=off",
)  # fmt: skip
_HERE: Final = Path(__file__).resolve().parent
_TRANSLATED: Final = ("estimators", "detection")
_SUFFIXES: Final = (".py", ".c", ".h", ".dbc")


class NoCompilerError(UserError, ValueError):
    """There is no C compiler, or it cannot compile the ECU."""


def library(calibration: Calibration, sections: Mapping[str, object] | None = None) -> Path:
    """The shared library of the ECU with the rules of this calibration; built if its sources have changed or it was never built.

    sections: the table of the calibration's file, for a library that also offers XCP and UDS.

    What the estimators know of the machine (`calibration.parameters`) is set in the loaded library: campaigns draw hundreds of machines.
    Errors: NoCompilerError; NoCacheFolderError where compiled code cannot be kept.
    """
    folder, file = _place(calibration, sections)
    if not file.exists():
        # built beside its place and moved there whole: another process may build the same at the same time
        with tempfile.TemporaryDirectory(dir=folder) as work:
            _build(calibration, sections, Path(work), folder).replace(file)
    return file


def built(calibration: Calibration) -> Path | None:
    """The library that `library` would give, if it was built before; None else, also where compiled code cannot be kept."""
    try:
        file = _place(calibration, None)[1]
    except NoCacheFolderError:
        return None
    return file if file.exists() else None


def _place(calibration: Calibration, sections: Mapping[str, object] | None) -> tuple[Path, Path]:
    """The folder of such libraries, and the file of this one in it."""
    folder = code_folder(_HERE, "ecu-in-c", _sources())
    return folder, folder / f"{_key(calibration, sections)}.so"


@lru_cache(maxsize=1)
def _sources() -> str:
    """Fingerprint of everything that the generated C depends on but the calibration."""
    # of the sources and not of the C: generating it takes two seconds, which every run would have to wait for
    packages = (_HERE, _HERE.parents[1] / "ecu", Path(dbc.__file__).parent)
    files = (file for package in packages for file in package.rglob("*"))
    return digest_of(sorted(f for f in files if f.suffix in _SUFFIXES and "__pycache__" not in f.parts))


def _key(calibration: Calibration, sections: Mapping[str, object] | None) -> str:
    """Fingerprint of the numbers that go into the C, and of the choice of compiler."""
    c = calibration
    # names and rules of the detection are not exported, and the machine's numbers are set after loading
    said = repr((c.limits, c.warnings, c.alarms, c.inputs, sections, OPTIONS, os.environ.get("CC", "")))
    return hashlib.sha256(said.encode()).hexdigest()[:16]


def _build(calibration: Calibration, sections: Mapping[str, object] | None, work: Path, kept: Path) -> Path:
    """Write the C into `work` and build it there; the estimators' object stays in `kept`."""
    # late: the translator is needed only where something is built, and takes a tenth of a run's start to load
    from deploy.c.project import write_project

    compiler = _compiler()
    write_project(work, calibration, sections)
    # three quarters of the time to compile, and the same for every calibration
    chosen = hashlib.sha256(os.environ.get("CC", "").encode()).hexdigest()[:8]
    translated = [kept / f"{name}-{chosen}.o" for name in _TRANSLATED]
    for name, made in zip(_TRANSLATED, translated, strict=True):
        if not made.exists():
            _compile(compiler, work, "-c", f"{name}.c", "-o", f"{name}.o")
            (work / f"{name}.o").replace(made)
    others = sorted(
        file.relative_to(work).as_posix()
        for folder in (".", "library", "services")
        for file in work.glob(f"{folder}/*.c")
        if file.stem not in _TRANSLATED
    )
    _compile(compiler, work, "-shared", "-I.", *others, *map(str, translated), "-o", "ecu.so", "-lm")
    return work / "ecu.so"


def _compiler() -> list[str]:
    """The command of the host's C compiler: $CC, else the first of COMPILERS."""
    chosen = shlex.split(os.environ.get("CC", ""))
    for words in [chosen] if chosen else [[name] for name in COMPILERS]:
        if found := shutil.which(words[0]):
            return [found, *words[1:]]
    tried = f"CC={os.environ['CC']}" if chosen else ", ".join(COMPILERS)
    raise NoCompilerError(
        f"the ECU in C needs a C compiler, and none is there (tried {tried}): install one (Debian: gcc and libc6-dev), "
        "or take the Python core"
    )


def _compile(compiler: list[str], work: Path, *words: str) -> None:
    done = subprocess.run(
        [*compiler, *OPTIONS, *words], cwd=work, capture_output=True, text=True, check=False
    )
    if done.returncode:
        first = next(
            (line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[:200]
        )
        raise NoCompilerError(
            f"{compiler[0]} cannot compile the ECU in C: {first}; are the C library's headers there?"
        )
