"""The walks of docs/walks, run as printed."""

import contextlib
import io
import re

import pytest

from tests.docs.pages import ROOT, fences

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
SHARE = 0.02
"""Of a printed number. Fits end where a step promises less than some 0.01 in SSE, and BLAS rounds by processor: statistics
near 50 then move by less than 0.1, sizes by less than a percent."""


def last_place(number: str) -> float:
    """What one unit of the last printed digit is worth: a value that is rounded may end on either side."""
    digits, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))


def same_text(printed: str, expected: str) -> bool:
    """Whether two outputs agree in words, and in numbers but for rounding."""
    if NUMBER.sub("#", printed) != NUMBER.sub("#", expected):
        return False
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(expected), strict=True)
    return all(abs(float(a) - float(b)) <= SHARE * abs(float(b)) + 1.01 * last_place(b) for a, b in pairs)


@pytest.mark.timeout(600)
def test_the_walk_of_one_effect_prints_what_it_says():
    names: dict[str, object] = {}
    printed = ""
    compared = 0
    page = (ROOT / "docs/walks/follow-one-effect.md").read_text(encoding="utf-8")
    for fence in fences(page):
        if fence.language == "python":
            assert not printed, f"the output before line {fence.line} is not on the page"
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile("\n" * (fence.line - 1) + fence.text, "follow-one-effect.md", "exec"), names)
            printed = out.getvalue()
        else:
            assert same_text(printed, fence.text), (
                f"line {fence.line}: the page says\n{fence.text}but\n{printed}"
            )
            printed, compared = "", compared + 1
    assert compared == 8


@pytest.mark.parametrize(
    ("printed", "same"),
    [
        ("drag: 48.8, p 3e-12\n", True),
        ("drag: 48.1, p 4e-12\n", True),
        ("drag: 53.0, p 3e-12\n", False),
        ("lag: 48.8, p 3e-12\n", False),
        ("drag: 48.8\n", False),
    ],
)
def test_outputs_are_compared_by_words_and_numbers(printed, same):
    assert same_text(printed, "drag: 48.8, p 3e-12\n") == same


def test_every_walk_is_named_in_the_entry_page():
    entry = (ROOT / "docs/README.md").read_text(encoding="utf-8")
    walks = sorted(p.name for p in (ROOT / "docs/walks").glob("*.md"))
    assert walks
    assert [w for w in walks if f"walks/{w}" not in entry] == []
