"""Verdicts with windows of several lengths."""

from dataclasses import replace
from pathlib import Path

import pytest

from diagnosis.window_lengths import across_lengths
from discrepancy.signals.findings import Finding, Findings, Status
from tests.diagnosis.cases import Call, columns, finding, loaderhil, model_file, unseen, write_csv
from tests.discrepancy.toys import record

__all__ = ["loaderhil"]
LEAK = finding("leak", "physics", {"leak": 0.05}, group=["seepage"], interval=(0.04, 0.06))


def result(*findings: Finding, status: Status = "explained", blind: str = "") -> Findings:
    return Findings(
        model="tank",
        recordings=["a.csv"],
        status=status,
        reasons=["as before"],
        findings=list(findings),
        candidates=[unseen(blind)] if blind else [],
    )


@pytest.mark.parametrize(
    ("ours", "theirs", "status", "said"),
    [
        (result(LEAK), result(LEAK), "explained", "found with windows of 5 s too: leak"),
        (
            result(LEAK),
            result(finding("seepage", "physics", {"k": 1.0})),
            "explained",
            "found with windows of 5 s too: leak",
        ),
        (
            result(LEAK),
            result(replace(LEAK, named=False, caveats=["closes 3% of the gap"]), status="unknown"),
            "explained in part",
            "leak depends on the length of the windows: with windows of 5 s it is not named: closes 3% of the gap",
        ),
        (
            result(LEAK),
            result(status="nothing missing"),
            "explained in part",
            "leak depends on the length of the windows: with windows of 5 s it is not named",
        ),
        (
            result(LEAK),
            result(status="nothing missing", blind="leak"),
            "explained",
            "as before",
        ),
        (
            result(LEAK),
            result(finding("leak", "physics", {"leak": 0.1}, interval=(0.08, 0.12))),
            "explained in part",
            "the size of leak depends on the length of the windows: with windows of 5 s leak = 0.100 (95 %: 0.080 to 0.120)",
        ),
        (
            result(status="nothing missing"),
            result(LEAK),
            "unknown",
            "leak depends on the length of the windows: with windows of 5 s it is named, leak = 0.050 (95 %: 0.040 to 0.060)",
        ),
        (result(status="nothing missing", blind="leak"), result(LEAK), "nothing missing", "as before"),
        (
            result(LEAK),
            result(status="inconclusive"),
            "explained",
            "with windows of 5 s these recordings allow no verdict: as before",
        ),
    ],
)  # fmt: skip
def test_what_depends_on_the_length_is_said(
    ours: Findings, theirs: Findings, status: Status, said: str
) -> None:
    found = across_lengths(ours, {5.0: theirs})
    assert (found.status, found.reasons[0]) == (status, said)
    assert found.reasons[-1] == "as before"


def test_a_leak_is_found_at_every_length(loaderhil: Call, tmp_path: Path) -> None:
    recording = write_csv(tmp_path / "a.csv", columns(record(1, leak=0.05)))
    ended = loaderhil(
        "diagnose", recording, "--model", model_file(tmp_path, "leak"), "--window", 10, "--window", 40
    )
    assert ended.code == 0
    assert "found with windows of 10 s and 40 s too: leak" in " ".join(ended.out.replace("│", " ").split())
    assert "so far explained; again with windows of 10 s" in ended.err


@pytest.mark.parametrize("length", ["0", "-1", "0.79", "nan"])
def test_a_window_of_too_few_steps_is_refused_before_anything_is_computed(
    length: str, loaderhil: Call, tmp_path: Path
) -> None:
    recording = write_csv(tmp_path / "a.csv", columns(record(1)))
    ended = loaderhil("diagnose", recording, "--model", model_file(tmp_path, "leak"), "--window", length)
    assert ended.code == 2
    assert f"--window {length}: tank needs at least 0.8 s, 8 of its steps of 0.1 s" in ended.err
    assert "screened" not in ended.err
