"""The reference page of findings.json says what the schema says, and nothing of fields that are no more."""

from pathlib import Path

from diagnosis.handbook import MEANING, page
from discrepancy.signals.findings import schema

ROOT = Path(__file__).parents[2]


def test_the_page_is_that_of_the_schema() -> None:
    assert (ROOT / "docs" / "reference" / "findings.md").read_text() == page(), "run scripts/findings-docs"


def test_every_field_has_its_meaning_and_every_meaning_its_field() -> None:
    made = schema()
    classes = {"Findings": made, **made["$defs"]}
    fields = {f"{name}.{field}" for name, described in classes.items() for field in described["properties"]}
    assert fields == set(MEANING)
