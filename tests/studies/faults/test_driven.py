"""Hours that an earlier commit drove without a fault count on the page, once each; alarms among them stay visible."""

import pytest

from bus.user_error import UserError
from studies.faults.document import page
from studies.faults.driven import keep, read_driven


def drive(seed, alarms=()):
    return {
        "what": f"random drive, seed {seed}",
        "kind": "random",
        "hours": 0.5,
        "alarms": list(alarms),
        "sizes": {},
        "outcomes": [],
    }


def test_kept_drives_are_read_back(tmp_path):
    keep(tmp_path / "kept.json", [drive(1), drive(2, ["roll at 3 s"])], "python -m x")
    found = read_driven(tmp_path / "kept.json")
    assert found.command == "python -m x"
    assert [(r["what"], r["hours"], r["alarms"]) for r in found.results] == [
        ("random drive, seed 1", 0.5, []),
        ("random drive, seed 2", 0.5, ["roll at 3 s"]),
    ]


def test_a_drive_of_both_runs_counts_once(tmp_path):
    keep(tmp_path / "kept.json", [drive(seed) for seed in range(1, 6)], "python -m x")
    text = page([drive(5), drive(6)], 3, "python -m y", read_driven(tmp_path / "kept.json"))
    assert "| random | 6 | 3.00 | 0 |" in text
    assert "Of these 4 drives are from `python -m x`" in text
    # the rule of three
    assert "Without one in 3.00 h the rate is below 1 per hour" in text


def test_an_alarm_among_kept_drives_is_on_the_page(tmp_path):
    keep(tmp_path / "kept.json", [drive(1, ["wrong calibration 2: roll at 3.00 s"])], "python -m x")
    text = page([drive(6)], 3, "python -m y", read_driven(tmp_path / "kept.json"))
    assert "wrong calibration 2: roll at 3.00 s" in text
    assert "the rate is below" not in text


@pytest.mark.parametrize(
    "text", ["", "[]", '{"results": []}', '{"command": "", "commit": "", "results": [{}]}']
)
def test_another_file_is_one_clear_error(tmp_path, text):
    file = tmp_path / "kept.json"
    file.write_text(text)
    with pytest.raises(UserError, match=r"kept\.json"):
        read_driven(file)


def test_a_missing_file_is_one_clear_error(tmp_path):
    with pytest.raises(UserError, match=r"none\.json"):
        read_driven(tmp_path / "none.json")
