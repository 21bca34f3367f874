"""docs/nomenclature.md against the code: names that it defines exist, names that it retires are not shown to users."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/nomenclature.md").read_text(encoding="utf-8")
PACKAGES = (
    "bus", "configuration", "dbc", "plant", "ecu", "discrepancy", "hil", "report", "diagnosis", "identify", "studies", "loaderhil", "testbench", "deploy",
)  # fmt: skip
DEFINED = PAGE[PAGE.index("## 2 ") : PAGE.index("## 4 ")]

RETIRED = re.compile(
    r"\b(spells?|pilots?|flown|unstrained|strained|twins?|laden|overheard|mortal|torn|doubts|noticed from"
    r"|stretch|stretches|absorbed|led by|Mistake|told|tells|recordings? cannot tell)\b"
)
"""Words of section 4 of the page, in the forms that sentences take."""


def names_in_tables(text: str) -> list[str]:
    """What stands in backticks in the first two columns of every table's row."""
    rows = [line.split("|")[1:3] for line in text.splitlines() if line.startswith("| ")]
    return sorted({name for row in rows for cell in row for name in re.findall(r"`([a-z_A-Z]+)`", cell)})


@pytest.fixture(scope="module")
def words_of_the_code() -> set[str]:
    """Every identifier-like word of the Python, TOML and DBC sources, and the parts of names joined by dots."""
    files = (
        f
        for p in (*PACKAGES, "bench")
        for f in (ROOT / p).rglob("*")
        if f.suffix in {".py", ".toml", ".dbc", ".json"}
    )
    return {word for f in files for word in re.findall(r"[A-Za-z_]\w*", f.read_text("utf-8"))} | {
        f.stem for p in PACKAGES for f in (ROOT / p).rglob("*.py")
    }


@pytest.mark.parametrize("name", names_in_tables(DEFINED))
def test_a_name_of_the_nomenclature_occurs_in_the_code(name, words_of_the_code):
    # a vector's name stands for its components: specific_force for specific_force_x
    assert any(w == name or w.startswith(f"{name}_") or w == f"{name}s" for w in words_of_the_code)


def sentences(source: str) -> Iterator[tuple[int, str]]:
    """Texts of several words that are no docstring, with their line."""
    tree = ast.parse(source)
    docstrings = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Constant) or id(node) in docstrings:
            continue
        if isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value


@pytest.mark.parametrize("package", PACKAGES)
def test_no_sentence_for_users_holds_a_retired_word(package):
    found = [
        f"{path.relative_to(ROOT)}:{line}: {word[0]!r} in {text!r}"
        for path in sorted((ROOT / package).rglob("*.py"))
        for line, text in sentences(path.read_text("utf-8"))
        for word in RETIRED.finditer(text)
    ]
    assert not found, "docs/nomenclature.md section 4 has the words to use instead:\n" + "\n".join(found)


def test_the_search_for_retired_words_sees_them_and_spares_docstrings():
    source = '"""A pilot."""\nx = f"{1} was flown here"\ny = "pilot"\nz = "the pilot flies"\n'
    assert sorted(line for line, text in sentences(source) if RETIRED.search(text)) == [2, 4]
