"""Machine code is made again when any source changes, also one that the function only calls."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from bus.cache_folder import INSTALLED
from bus.machine_code import (
    COUNTED,
    NEEDED,
    UNCOUNTED,
    compiler,
    direct,
    has_processor,
    uncounting,
)

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[2]
OUTER = """\
from pathlib import Path
from bus.cache_folder import digest_of
from bus.machine_code import code_folder, compiler
here = Path(__file__).parent
folder = code_folder(here, "code", digest_of(sorted(here.glob("*.py"))))
compiled = compiler(folder)
from inner import inner

@compiled
def outer():
    return inner()

print(outer(), sum(outer.stats.cache_hits.values()))
"""
INNER = """\
from numba import njit

@njit
def inner():
    return {value}
"""


@pytest.mark.processes
@pytest.mark.parametrize("chosen", [False, True], ids=["beside the source", "NUMBA_CACHE_DIR"])
def test_a_changed_callee_is_noticed_and_an_unchanged_one_is_not_compiled_again(tmp_path, chosen):
    package = tmp_path / "package"
    package.mkdir()
    (package / "outer.py").write_text(OUTER)
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(ROOT)
    # Python goes by size and second of a source: bytecode of the callee before it changed would be taken
    environment["PYTHONDONTWRITEBYTECODE"] = "1"
    if chosen:
        environment["NUMBA_CACHE_DIR"] = str(tmp_path / "chosen")
    said = []
    for value in (1, 1, 2):
        (package / "inner.py").write_text(INNER.format(value=value))
        done = subprocess.run(
            [sys.executable, package / "outer.py"],
            capture_output=True,
            text=True,
            env=environment,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        said.append(done.stdout.split())
    assert said == [["1", "0"], ["1", "1"], ["2", "0"]]
    assert (package / "__pycache__").exists() != chosen or not list((package / "__pycache__").glob("code-*"))


class Pair(NamedTuple):
    """Arrays that are handed around together."""

    first: Array
    second: Array


def swap_rows(pair: Pair) -> float:
    """Takes parts of arrays, which is what numba counts."""
    a, b = pair.first[0], pair.second[1]
    for i in range(a.size):
        a[i], b[i] = b[i], a[i]
    return float(a[0])


def counts(function, pair: Pair) -> bool:
    """Whether the machine code of a compiled function counts references."""
    function(pair)
    (code,) = function.inspect_llvm().values()
    return "@NRT_decref(" in code


def pair() -> Pair:
    return Pair(np.arange(6.0).reshape(2, 3), np.arange(6.0, 12.0).reshape(2, 3))


def test_numba_leaves_the_counting_out_where_it_is_asked_to(tmp_path):
    """Fails with a numba that has dropped or renamed its option: the plant is then right, but half as fast."""
    assert counts(compiler(tmp_path / "a", **COUNTED)(swap_rows), pair())
    assert not counts(uncounting(tmp_path / "b")(swap_rows), pair())


def test_counted_and_uncounted_code_do_the_same(tmp_path):
    one, other = pair(), pair()
    results = [
        compiler(tmp_path / "a", **COUNTED)(swap_rows)(one),
        uncounting(tmp_path / "b")(swap_rows)(other),
    ]
    assert results[0] == results[1] == 9.0
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


def test_what_calls_nothing_counted_may_still_call_what_allocates(tmp_path):
    """numba's option is inherited by callees: COUNTED keeps a callee's own."""
    compiled = compiler(tmp_path, **COUNTED)

    @compiled
    def doubled(a: Array) -> Array:
        return a + a

    @compiled
    def last_of_double(a: Array) -> float:
        return float(doubled(a)[-1])

    @uncounting(tmp_path)
    def outer(a: Array) -> float:
        return last_of_double(a) + 1.0

    assert outer(np.arange(4.0)) == 7.0


def test_direct_code_does_what_the_function_does(tmp_path):
    one, other = pair(), pair()
    swapped = uncounting(tmp_path)(swap_rows)
    code = direct(swapped, pair())
    assert swapped.signatures  # compiled by the types, without a call
    assert swapped(one) == code(other) == 9.0
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


def test_direct_code_refuses_what_is_no_array(tmp_path):
    code = direct(uncounting(tmp_path)(swap_rows), pair())
    with pytest.raises(TypeError):
        code(Pair(1.0, [2.0]))  # type: ignore[arg-type]


def gives_an_array(a: Array) -> Array:
    return a


def gives_an_array_within(a: Array) -> tuple[float, Array]:
    return 0.0, a


def says_nothing(a):
    return a[0]


@pytest.mark.parametrize("function", [gives_an_array, gives_an_array_within, says_nothing])
def test_a_result_that_could_hold_an_array_is_refused(function, tmp_path):
    with pytest.raises(TypeError, match=function.__name__):
        uncounting(tmp_path)(function)


@pytest.mark.skipif(not UNCOUNTED, reason="this numba has no such option")
def test_what_allocates_is_refused_by_numba(tmp_path):
    @uncounting(tmp_path)
    def allocates(n: int) -> float:
        return float(np.zeros(n)[0])

    with pytest.raises(numba.errors.NumbaError):
        allocates(3)


SMALL = """\
import sys
import llvmlite.binding as llvm
if "old" in sys.argv:
    features = llvm.get_host_cpu_features()
    features["avx2"] = False
    llvm.get_host_cpu_features = lambda: features
import numba
from pathlib import Path
from bus.cache_folder import digest_of
from bus.machine_code import code_folder, compiler
here = Path(__file__).resolve().parent
compiled = compiler(code_folder(here, "code", digest_of(sorted(here.glob("*.py")))))

@compiled
def answer():
    return 42

print(answer(), sum(answer.stats.cache_hits.values()), numba.config.CPU_NAME)
"""


def installation(folder: Path) -> Path:
    """A folder as pip installs it, with what keeps machine code and a package that has some."""
    (folder / "small").mkdir(parents=True)
    (folder / "small" / "small.py").write_text(SMALL)
    (folder / "bus").mkdir()
    for name in ("__init__.py", "cache_folder.py", "machine_code.py", "user_error.py"):
        shutil.copy(ROOT / "bus" / name, folder / "bus")
    return folder


def answered(installed: Path, *options: str, **settings: str) -> list[str]:
    """What the package in this folder prints: the answer, how often code was found, the processor."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(installed), "PYTHONDONTWRITEBYTECODE": "1"} | settings
    program = [sys.executable, "-P", installed / "small" / "small.py", *options]
    return subprocess.run(program, capture_output=True, text=True, env=environment, check=True).stdout.split()


@pytest.mark.processes
def test_code_is_found_after_the_package_has_moved(tmp_path):
    first = installation(tmp_path / "first")
    assert answered(first)[:2] == ["42", "0"]
    second = first.rename(tmp_path / "second")
    assert answered(second)[:2] == ["42", "1"]


@pytest.mark.processes
def test_code_that_was_installed_is_taken_along_to_another_place(tmp_path):
    installed = installation(tmp_path / "installed")
    answered(installed)
    place = str(tmp_path / "chosen")
    assert answered(installed, NUMBA_CACHE_DIR=place)[:2] == ["42", "0"]  # made here, not installed
    shutil.rmtree(place)
    [folder] = (installed / "small" / "__pycache__").glob("code-*")
    (folder / INSTALLED).touch()
    assert answered(installed, NUMBA_CACHE_DIR=place)[:2] == ["42", "1"]


@pytest.mark.processes
def test_a_processor_that_lacks_something_compiles_for_itself(tmp_path):
    installed = installation(tmp_path / "installed")
    answered(installed)
    assert answered(installed, "old") == ["42", "0", "None"]


@pytest.mark.processes
def test_a_users_choice_of_processor_stays(tmp_path):
    installed = installation(tmp_path / "installed")
    answered(installed)
    assert answered(installed, NUMBA_CPU_NAME="generic") == ["42", "0", "generic"]


def test_each_part_of_the_processor_is_needed():
    everything = dict.fromkeys(NEEDED, True) | {"avx512f": False}
    assert has_processor("x86_64", everything)
    assert not has_processor("aarch64", everything)
    for name in NEEDED:
        assert not has_processor("x86_64", everything | {name: False}), name
