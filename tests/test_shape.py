"""Limits on the shape of the source tree, and the program that measures it (bench.shape)."""

from pathlib import Path

import pytest

from bench.shape import (
    BENCHES,
    ROOT,
    by_package,
    circles_and_levels,
    import_graph,
    read_module,
    read_tree,
    shape,
)

LONGEST_BODY = 80  # without docstring and signature, in which a command declares each option with its help
LONGEST_MODULE = 500
FULLEST_FOLDER = 20
LARGEST_BENCH = 13_000  # lines of hil/, comments not counted; it once held five products in 25 800
REGISTRY = "plant.effects.library"  # one file per effect, found by name: as many as there are effects


@pytest.fixture(scope="module")
def modules():
    return [m for m in read_tree(ROOT) if m.name.split(".")[0] not in BENCHES]


def test_no_modules_import_each_other_in_a_circle(modules):
    assert shape(modules).circles == ()


def test_no_function_body_is_longer_than_the_limit(modules):
    assert [f for f in shape(modules).functions if f.body_lines > LONGEST_BODY] == []


def test_no_module_is_longer_than_the_limit(modules):
    assert [(m.name, m.lines) for m in modules if m.lines > LONGEST_MODULE] == []


def test_no_folder_holds_more_modules_than_the_limit(modules):
    flat = shape([m for m in modules if not m.name.startswith(REGISTRY)])
    assert flat.fullest_folder <= FULLEST_FOLDER


def test_the_bench_stays_small(modules):
    bench = by_package(modules)["hil"]
    assert bench.lines - sum(m.comment_lines for m in bench.modules) <= LARGEST_BENCH


SOURCES = {
    "a/__init__.py": "",
    "a/one.py": "from a import two\n# why\nx = 1  # m\n",
    "a/two.py": "def f():\n    from a.three import g\n    return g\n",
    "a/three.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .one import x\ng = 1\n",
    "b/__init__.py": "",
    "b/top.py": "import a.one\nfrom b.low import y\n\ndef long():\n    '''Docstring.'''\n\n    return y\n",
    "b/low.py": "y = 2\n",
}


@pytest.fixture
def small_tree(tmp_path: Path):
    for name, text in SOURCES.items():
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return read_tree(tmp_path)


def test_circles_are_seen_through_functions_types_and_relative_imports(small_tree):
    circles, _ = circles_and_levels(import_graph(small_tree))
    assert circles == [("a.one", "a.three", "a.two")]


def test_levels_count_a_circle_once(small_tree):
    # the circle of package a below b.top, and nothing below the circle
    assert circles_and_levels(import_graph(small_tree))[1] == 2
    assert circles_and_levels({"x": {"y"}, "y": {"z"}, "z": set()})[1] == 3


def test_comments_and_lengths_are_counted_line_by_line(tmp_path, small_tree):
    one = next(m for m in small_tree if m.name == "a.one")
    assert (one.lines, one.filled_lines, one.comment_lines, one.commented_lines) == (3, 3, 1, 2)
    top = next(m for m in small_tree if m.name == "b.top")
    assert [(f.lines, f.body_lines) for f in top.functions] == [(4, 1)]


def test_a_comment_sign_in_a_text_is_no_comment(tmp_path):
    file = tmp_path / "m.py"
    file.write_text('x = "# none"\n')
    assert read_module(tmp_path, file).commented_lines == 0
