"""`loaderhil experiment`, as a user calls it, with a model of a few lines."""

import json
from pathlib import Path

import pytest

from diagnosis.reading.csv_writer import csv_text
from tests.diagnosis.cases import Call, loaderhil
from tests.discrepancy.springs import stretched

__all__ = ["loaderhil"]

MODEL = "from tests.discrepancy.springs import MANOEUVRES, spring\nmodel = spring({})\n"


def spring_file(folder: Path, manoeuvres: str = "MANOEUVRES") -> Path:
    path = folder / "spring.py"
    path.write_text(MODEL.format(manoeuvres))
    return path


def rounds(folder: Path) -> list[dict[str, object]]:
    found = json.loads((folder / "experiment.json").read_text())["rounds"]
    assert isinstance(found, list)
    return found


@pytest.fixture
def blind(tmp_path: Path, loaderhil: Call) -> tuple[Path, Path, Path]:
    """Model file, recording at one amplitude and sealed truth: the spring stiffens with the way."""
    model, folder = spring_file(tmp_path), tmp_path / "blind"
    like = tmp_path / "like.csv"
    like.write_text(csv_text(stretched(1)))
    words = (
        "conceal",
        folder,
        "--model",
        model,
        "--effect",
        "cubic=0.5",
        "--noise",
        "force=0.2",
        "--like",
        like,
    )
    # conceal takes its folder as an argument; the fixture adds --out for the other commands
    import sys

    from loaderhil import cli

    before = sys.argv
    sys.argv = ["loaderhil", *map(str, words)]
    with pytest.raises(SystemExit) as ended:
        cli.main()
    sys.argv = before
    assert ended.value.code in (0, None)
    return model, folder / "recording.csv", folder / "truth.sealed"


def test_the_manoeuvre_that_distinguishes_is_proposed(
    blind: tuple[Path, Path, Path], tmp_path: Path, loaderhil: Call
) -> None:
    model, recording, _ = blind
    ended = loaderhil("experiment", recording, "--model", model, folder=tmp_path / "next")
    assert ended.code == 5
    assert "cannot distinguish" in ended.out
    assert "Next, record further: Stretch the spring by 2 m and back." in ended.out
    (first,) = rounds(tmp_path / "next")
    assert first["chosen"] == "further"  # the shorter one of two that are beyond doubt
    assert sorted(first["groups"][0]) == ["cubic", "stiffer"]  # type: ignore[index]
    assert (tmp_path / "next" / "round-0" / "report.html").is_file()


def test_with_the_sealed_truth_one_name_is_left(
    blind: tuple[Path, Path, Path], tmp_path: Path, loaderhil: Call
) -> None:
    model, recording, truth = blind
    ended = loaderhil("experiment", recording, "--model", model, "--sealed", truth, folder=tmp_path / "next")
    assert ended.code == 0, ended.out
    before, after = rounds(tmp_path / "next")
    assert (before["outcome"], after["resolved"]) == ("driven", True)
    assert after["findings"] == [{"effect": "cubic", "named": True, "group": []}]
    again = loaderhil("experiment", recording, "--model", model, "--sealed", truth, folder=tmp_path / "next")
    assert (again.code, rounds(tmp_path / "next")) == (0, [before, after])
    page = (tmp_path / "next" / "experiment.html").read_text()
    assert "round-1/report.html" in page
    assert "explained: cubic" in page


def test_where_no_manoeuvre_distinguishes_them_it_says_so(
    blind: tuple[Path, Path, Path], tmp_path: Path, loaderhil: Call
) -> None:
    model, recording, truth = blind
    spring_file(tmp_path, "MANOEUVRES[:1]")
    ended = loaderhil("experiment", recording, "--model", model, "--sealed", truth, folder=tmp_path / "next")
    assert ended.code == 1
    assert "No manoeuvre of the list would distinguish them" in ended.out
    (only,) = rounds(tmp_path / "next")
    assert only["chosen"] is None


def test_nothing_to_distinguish_ends_at_once(tmp_path: Path, loaderhil: Call) -> None:
    quiet = tmp_path / "quiet.csv"
    quiet.write_text(csv_text(stretched(7)))
    ended = loaderhil("experiment", quiet, "--model", spring_file(tmp_path), folder=tmp_path / "next")
    assert ended.code == 1
    assert "There is no finding, so there is nothing to distinguish." in ended.out


@pytest.mark.parametrize(
    ("manoeuvres", "words", "said"),
    [
        ("()", (), "states no manoeuvres"),
        ("MANOEUVRES", ("--scenario", "loaded"), "--scenario: is for the loader"),
        ("MANOEUVRES", ("--sealed", "missing.sealed"), "missing.sealed: the sealed truth cannot be opened"),
    ],
)
def test_wrong_use_is_one_line(
    blind: tuple[Path, Path, Path],
    tmp_path: Path,
    loaderhil: Call,
    manoeuvres: str,
    words: tuple[str, ...],
    said: str,
) -> None:
    _, recording, _ = blind
    model = spring_file(tmp_path, manoeuvres)
    ended = loaderhil("experiment", recording, "--model", model, *words, folder=tmp_path / "next")
    assert ended.code == 2
    assert said in ended.err
    assert "Traceback" not in ended.err
