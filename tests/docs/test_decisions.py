"""Decisions (docs/adr): one page each, a number each, all of them in the index."""

import re

from tests.docs.pages import ROOT

FOLDER = ROOT / "docs/adr"
PAGES = sorted(p for p in FOLDER.glob("*.md") if p.name != "README.md")
LONGEST = 4500  # characters: a printed page of small type; the longest of the first nineteen had 3 200


def test_every_decision_has_a_number_of_its_own_as_printed():
    numbers = [int(p.name[:4]) for p in PAGES]
    assert len(set(numbers)) == len(numbers), "two decisions with one number: rename the newer one"
    titles = [re.match(r"# (?:ADR )?(\d+)[.:]", p.read_text("utf-8")) for p in PAGES]
    assert [int(t[1]) if t else None for t in titles] == numbers


def test_every_decision_is_in_the_index():
    index = (FOLDER / "README.md").read_text("utf-8")
    assert [p.name for p in PAGES if f"]({p.name})" not in index] == []


def test_a_decision_is_one_page_with_its_four_parts():
    for page in PAGES:
        text = page.read_text("utf-8")
        assert len(text) <= LONGEST, f"{page.name} has {len(text)} characters: figures belong in docs/results"
        parts = ("Context", "Decision", "Alternatives", "Consequences")
        assert [p for p in parts if p not in text] == [], page.name
