"""The entry page names every page for readers, and the changelog stays in its groups."""

import re

from tests.docs.pages import ROOT

ENTRY = (ROOT / "docs/README.md").read_text(encoding="utf-8")


def test_every_how_to_walk_and_explanation_is_in_the_entry_page():
    pages = [
        p
        for folder in ("howto", "walks", "explanation")
        for p in sorted((ROOT / "docs" / folder).glob("*.md"))
    ]
    assert [p.name for p in pages if f"({p.parent.name}/{p.name})" not in ENTRY] == []


def test_the_changelog_groups_by_feature():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    groups = re.findall(r"^### (.+)$", text, re.MULTILINE)
    # a merge brought the old list back twice: move new lines to their feature's group
    assert "Added" not in groups
    assert len(groups) == len(set(groups))
