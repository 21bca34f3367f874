"""The translator: what it takes means the same in C, and what it cannot translate exactly it refuses by file and line."""

import ctypes
import math
import re
from pathlib import Path

import pytest

from deploy.c.estimators import DIVIDED, MODULO, NOTED
from deploy.c.project import RUNTIME
from deploy.c.translation.names import wrapped
from deploy.c.translation.program import Translation
from deploy.c.translation.refused import TranslationRefused
from tests.deploy.c import snippets
from tests.deploy.c.building import STRICT, build

ROOT = Path(snippets.__file__).parents[3]
NUMBERS = (-7.25, -3.0, -1.0, -0.5, -0.0, 0.0, 0.1, 1.0, 1.5, 2.0, 3.0, 4.0, 5.5, 1e9, math.inf)


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """Every function of TAKEN in double precision, as NAME_in_c, and whether a division failed."""
    folder = tmp_path_factory.mktemp("snippets")
    translation = Translation(ROOT)
    names = [translation.add(function) for function in snippets.TAKEN]
    entries = [
        f"double {name}_in_c(double a, double b) {{ failed = false; return {name}(a, b); }}" for name in names
    ]
    protos = [f"double {name}_in_c(double a, double b);" for name in names]
    text = "\n".join(
        ['#include "real.h"', "#include <string.h>", "#define NEVER_NS INT64_MIN", *protos, "bool failed_in_c(void);", (NOTED + DIVIDED).replace("divided_by_zero", "failed"), MODULO,
         translation.file.types, translation.file.definitions, *translation.file.functions, *entries,
         "bool failed_in_c(void) { return failed; }"]
    )  # fmt: skip
    (folder / "snippets.c").write_text(text)
    out = build(
        [folder / "snippets.c"],
        folder / "snippets.so",
        *STRICT,
        "-shared",
        "-fPIC",
        "-DECU_DOUBLE",
        f"-I{RUNTIME}",
    )
    return ctypes.CDLL(str(out))


@pytest.mark.parametrize("function", snippets.TAKEN, ids=lambda function: function.__name__)
def test_c_means_what_python_means(library, function):
    """Every pair of ordinary, signed-zero and infinite numbers; where Python raises, C has noted a failure."""
    in_c = getattr(library, f"snippets_{function.__name__}_in_c")
    in_c.restype, in_c.argtypes = ctypes.c_double, [ctypes.c_double, ctypes.c_double]
    for a in NUMBERS:
        for b in NUMBERS:
            if function is snippets.chosen and math.isinf(a):
                continue  # int() of infinity raises, and a cast of it has no meaning in C: inputs are finite
            found = in_c(a, b)
            try:
                expected = function(a, b)
            except ZeroDivisionError:
                assert library.failed_in_c(), (a, b)
                continue
            assert not library.failed_in_c(), (a, b)
            same = (
                math.isnan(found)
                if math.isnan(expected)
                else (found, math.copysign(1, found)) == (expected, math.copysign(1, expected))
            )
            assert same, (a, b, found, expected)


@pytest.mark.parametrize(
    ("function", "word"), snippets.REFUSED.items(), ids=lambda item: getattr(item, "__name__", "")
)
def test_what_has_no_exact_counterpart_is_refused(function, word):
    with pytest.raises(TranslationRefused, match=word) as error:
        Translation(ROOT).add(function)
    first = function.__code__.co_firstlineno
    where = re.match(r".*snippets\.py:(\d+): cannot be translated to C: ", str(error.value))
    assert where is not None
    assert first <= int(where.group(1)) <= first + 6


def test_names_comments_and_units_are_kept():
    """The reader of the C finds the Python function, its words and its line."""
    translation = Translation(ROOT)
    translation.add(snippets.length)
    assert "real_t x; /* to the right [m] */" in translation.file.types
    line = snippets.length.__code__.co_firstlineno
    assert f"Python: tests/deploy/c/snippets.py:{line}" in translation.file.functions[-1]
    assert "A record as an argument, its parts by name and by unpacking." in translation.file.functions[-1]


def test_two_classes_of_one_name_stay_apart():
    other = type(snippets.Point)("Point", (), {"__annotations__": {}})
    names = Translation(ROOT).names
    assert names.record(snippets.Point) == "Point"
    assert names.record(other) != "Point"


def test_long_lines_are_broken_between_words():
    line = "    " + " ".join(["word"] * 60) + ";"
    broken = wrapped(line)
    assert " ".join(broken.split()) == " ".join(line.split())
    assert max(map(len, broken.splitlines())) <= 110
