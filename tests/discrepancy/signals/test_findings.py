"""findings.json and its schema."""

import json
from dataclasses import replace

import pytest
from pydantic import ValidationError

from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import (
    RENAMED,
    SCHEMA,
    SCHEMA_VERSION,
    Estimate,
    Findings,
    from_json,
    schema_text,
    to_json,
)
from tests.discrepancy.toys import record, tank

Ends = tuple[float | None, float | None]


def test_the_schema_in_the_repository_is_that_of_the_classes() -> None:
    assert SCHEMA.read_text() == schema_text()


def test_findings_survive_json_and_say_what_was_found() -> None:
    result = examine(tank(), [record(2, leak=0.08)], Settings())
    text = to_json(result)
    assert "NaN" not in text
    assert "Infinity" not in text
    back = from_json(text)
    assert back.findings[0].effect == "leak"
    assert to_json(back) == text


def test_a_damaged_file_is_refused_with_the_place() -> None:
    whole = json.loads(to_json(examine(tank(), [record(2)], Settings())))
    whole["status"] = "perhaps"
    with pytest.raises(ValidationError, match="status"):
        from_json(json.dumps(whole))


def test_what_is_smaller_than_noticed_from_is_not_found_and_what_is_larger_is() -> None:
    """The size comes from one recording without the effect, and holds for others with it."""
    model, settings = tank("level delay"), Settings(open_ended=False)
    [limit] = examine(model, [record(1)], settings).candidates[0].smallest_detectable
    assert limit.name == "level.delay"
    for share, found in ((0.4, []), (1.6, ["level delay"])):
        for seed in range(2, 8):
            late = record(seed, delay_s=share * limit.value)
            assert examine(model, [late], settings).named == found


def test_no_size_is_noticed_of_what_nuisances_can_do_as_well() -> None:
    [sign] = [c for c in examine(tank(), [record(1)], Settings()).candidates if c.effect == "level sign"]
    assert (sign.verdict, sign.smallest_detectable) == ("could not be judged", [])


def test_files_of_version_1_are_read_by_the_names_of_their_time() -> None:
    """Channels may have the name of a field."""
    found = examine(tank(), [record(2, leak=0.08)], Settings())
    first = replace(found.findings[0], held_out_error={"gain": 0.5, **found.findings[0].held_out_error})
    whole = replace(found, findings=[first, *found.findings[1:]])
    text = to_json(whole).replace(f'"schema_version": {SCHEMA_VERSION}', '"schema_version": 1')
    for names in RENAMED.values():
        for old, new in names.items():
            text = text.replace(f'"{new}":', f'"{old}":')
    assert '"doubts"' in text
    assert from_json(text) == whole


def test_files_of_version_3_are_read_by_the_name_of_a_missing_channels_pairs() -> None:
    pair = {"what": "a from b", "change": 0.1, "share": 0.5}
    channel = {"channel": "flow", "unit": "m/s", "would_judge": [], "would_part": [pair]}
    whole = Findings(model="tank", recordings=["r"], status="unknown", reasons=[], samples=9)
    raw = json.loads(to_json(whole)) | {"schema_version": 3, "missing_channels": [channel]}
    [read] = from_json(json.dumps(raw)).missing_channels
    assert [each.what for each in read.would_distinguish] == ["a from b"]


def test_files_of_version_2_are_read_and_know_no_adequacy() -> None:
    whole = Findings(model="tank", recordings=["r"], status="explained", reasons=[], samples=9)
    raw = json.loads(to_json(whole)) | {"schema_version": 2}
    del raw["adequacy"]
    assert from_json(json.dumps(raw)) == whole


@pytest.mark.parametrize(
    ("one", "other", "common"),
    [
        ((1.0, 2.0), (2.0, 3.0), True),
        ((1.0, 2.0), (2.1, 3.0), False),
        ((1.0, 4.0), (2.0, 3.0), True),
        ((None, 2.0), (-9.0, 1.0), True),
        ((1.0, None), (9.0, 10.0), True),
        ((None, 2.0), (2.1, None), False),
    ],
)
def test_intervals_overlap_from_either_side(one: Ends, other: Ends, common: bool) -> None:
    a, b = (Estimate(name="k", value=0.0, low=low, high=high, unit="1") for low, high in (one, other))
    assert a.overlaps(b) is b.overlaps(a) is common
