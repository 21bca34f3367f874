"""Scoring: each interval is judged by the truth, and what does not belong together is refused."""

import json

import pytest

from diagnosis.blind.hidden import Truth
from diagnosis.blind.seal import seal
from identify.score import NotScored, scored


def row(value, half):
    return {"value": value, "sd": half / 1.96, "lower": value - half, "upper": value + half}


@pytest.fixture
def files(tmp_path):
    recording = tmp_path / "field.toml"
    recording.write_text("name = 'x'\n")
    effects = {
        "tyre": {"PKX1": 7.5, "PCX1": 1.4, "PEX2": 0.0},
        "measurement": {"offset": 3.2, "drift": 4e-5, "gain": 1.002, "tare": 40.0},
    }
    (tmp_path / "truth.sealed").write_text(
        seal(Truth(model="identify field", seed=1, effects=effects), [recording])
    )
    content = {
        "parameters": {
            "PKX1": row(7.6, 0.2),
            "PCX1": row(1.5, 0.05),
            "gain": row(1.0, 0.01),
            "tare": row(0.0, 1.0),
        },
        "clock": {"offset_s": 3.2004, "offset_sd_s": 0.0003, "drift": 9e-5, "drift_sd": 1e-6},
    }
    (tmp_path / "identification.json").write_text(json.dumps(content))
    return tmp_path / "identification.json", tmp_path / "truth.sealed", recording


def test_intervals_are_judged_by_the_truth(files):
    got = {r.name: r.inside for r in scored(*files[:2])}
    assert got == {"PKX1": True, "PCX1": False, "gain": True, "offset": True, "drift": False}


def test_a_recording_that_was_changed_is_refused(files):
    files[2].write_text("name = 'y'\n")
    with pytest.raises(NotScored, match="changed after it was made"):
        scored(*files[:2])


def test_a_truth_of_a_diagnosis_is_refused(files, tmp_path):
    files[1].write_text(seal(Truth(model="ball", seed=1, effects={}), [files[2]]))
    with pytest.raises(NotScored, match="loaderhil score"):
        scored(*files[:2])


@pytest.mark.parametrize("text", ["", "[]", '{"parameters": {"PKX1": 3}}'])
def test_a_file_that_is_no_identification_is_refused(files, text):
    files[0].write_text(text)
    with pytest.raises(NotScored, match="is no identification"):
        scored(*files[:2])
