"""Builds written C with the host's compiler and calls it: estimators as rows in, rows out."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from ecu.estimators.signals import Estimates
from ecu.estimators.state import INITIAL

STRICT = (
    "-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wpedantic", "-Werror",
)  # fmt: skip
"""Not a warning, also of those that the two usual groups leave out."""


def compiler():
    """The host's C compiler; skips where there is none."""
    found = shutil.which("gcc")
    if found is None:
        pytest.skip("no gcc: Debian's packages gcc and libc6-dev")
    return found


def build(sources, out, *options):
    """Compile and link; the compiler's words are the failure."""
    run = subprocess.run(
        [compiler(), *options, *map(str, sources), "-o", str(out), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr[:4000]
    return out


def write(folder, files):
    """Put generated files into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


def flat(record):
    """All numbers of nested named tuples in their order: as the struct has them in memory."""
    found = []
    for value in record:
        found += flat(value) if isinstance(value, tuple) else [float(value)]
    return found


class BuiltEstimators:
    """`estimators_cycle` of a shared library."""

    def __init__(self, library: Path, real, parameters):
        """real: np.float32 or np.float64, as the library was built."""
        self._library = ctypes.CDLL(str(library))
        self._library.estimators_cycle.restype = ctypes.c_bool
        self._real = real
        self._parameters = np.array(flat(parameters), real)

    def perturb(self, seed):
        """Begin another draw of the perturbed build."""
        self._library.perturbed_start(ctypes.c_uint64(seed))

    def cycle(self, row, state):
        """One cycle: estimates, whether it went well; `state` is written."""
        inputs, estimates = (
            np.ascontiguousarray(row, self._real),
            np.zeros(len(Estimates._fields), self._real),
        )
        at = [ctypes.c_void_p(a.ctypes.data) for a in (inputs, state, self._parameters, estimates)]
        return estimates, bool(self._library.estimators_cycle(*at))

    def columns(self, rows):
        """Estimates of consecutive cycles from the initial state, (n, estimates), double."""
        state = self.initial()
        found = [self.cycle(row, state) for row in rows]
        assert all(well for _, well in found)
        return np.array([estimates for estimates, _ in found], float)

    def initial(self):
        """The state before the first cycle."""
        return np.array(flat(INITIAL), self._real)
